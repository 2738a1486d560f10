"""Drafting machines of the workshop's modules."""

import numpy as np
from tests.simulation.designs.draft import DOWN, EAST, NORTH, SOUTH, UP, WEST, Direction, Draft

from buildarena_geometry import Machine
from buildarena_geometry.modules.sets import module_set


class WorkshopDraft(Draft):
    """A draft of a machine of the workshop's modules."""

    def __init__(self) -> None:
        self.machine = Machine(catalogue=module_set("workshop"))
        self.actions = []

    def placed(self, base: str, face: Direction, module: str, y_axis: Direction) -> str:
        """A block on a face, twisted until its own y axis looks a way."""
        made = self.attach(base, face, module)
        for angle in (0, 90, 180, 270):
            trial = self.machine.copy()
            if angle and not trial.act("twist_block", {"block_id": made, "angle": angle}).ok:
                continue
            turn = np.array(trial.blocks[made].world_from_block.rotation)
            if turn[:, 1] @ np.array(y_axis, dtype=float) > 0.999:
                if angle:
                    self.do("twist_block", block_id=made, angle=angle)
                return made
        raise ValueError(f"the y axis of block {made} cannot look towards {y_axis}")


def airship() -> Machine:
    """A long frame of sixty parts with wings, blades, fans, balloons and springs."""
    draft = WorkshopDraft()
    start = draft.start()
    south = draft.row(start, SOUTH, 12)
    spine = [*reversed(south), start, *draft.row(start, NORTH, 12)]
    for k in range(1, 24, 4):
        for side in (EAST, WEST):
            draft.placed(spine[k], side, "Wing Panel", UP)
    for k in range(0, 25, 3):
        draft.attach(spine[k], UP, "Balloon")
    for k in range(3, 23, 4):
        draft.attach(spine[k], DOWN, "Flying Block")
    for k in (1, 5, 13, 17):
        draft.placed(spine[k], DOWN, "Propeller", NORTH)
    for k in (0, 24):
        draft.placed(spine[k], DOWN, "Drag Block", NORTH)
    for k in (2, 10, 16):
        draft.link(spine[k], DOWN, spine[k + 6], DOWN, connector="Spring")
    return draft.machine
