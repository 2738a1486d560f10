"""Drafting machines of the workshop's modules."""

import numpy as np
from tests.simulation.designs.draft import Direction, Draft

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
