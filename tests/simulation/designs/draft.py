"""Drafting machines by directions, and replaying the logs that drafts leave."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from buildarena_geometry import Machine

Actions = list[dict[str, Any]]
Direction = tuple[int, int, int]

EAST, WEST = (1, 0, 0), (-1, 0, 0)
NORTH, SOUTH = (0, 1, 0), (0, -1, 0)
UP, DOWN = (0, 0, 1), (0, 0, -1)
WOOD, WHEEL, CANNON, TORCH = "Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch"
BRACE, WINCH = "Brace", "Winch"


class Draft:
    """A machine being drafted by directions instead of face labels, with the log it leaves."""

    def __init__(self, available: dict[str, Machine] | None = None) -> None:
        self.machine = Machine(available=available) if available else Machine()
        self.actions: Actions = []

    def do(self, op: str, **params: Any) -> None:
        outcome = self.machine.act(op, params)
        if not outcome.ok:
            raise ValueError(f"{op} {params}: {outcome.text}")
        self.actions.append({"op": op, "params": params})

    def start(self) -> str:
        self.do("start")
        return "1"

    def face(self, block: str, direction: Direction) -> str:
        """The face of a block that looks a way."""
        wanted = np.array(direction, dtype=float)
        found = self.machine.blocks[block]
        for face in found.module.faces:
            if found.world_from_face(face.label).rotation[:, 2] @ wanted > 0.999:
                return face.label
        raise ValueError(f"block {block} has no face towards {direction}")

    def attach(self, base: str, direction: Direction, module: str = WOOD) -> str:
        self.do(
            "attach_block_to",
            base_block=base,
            face=self.face(base, direction),
            new_block=module,
        )
        return list(self.machine.blocks)[-1]

    def row(self, base: str, direction: Direction, count: int) -> list[str]:
        """Blocks one after the other from a base on; the base is not among them."""
        made = []
        for _ in range(count):
            base = self.attach(base, direction)
            made.append(base)
        return made

    def connect(
        self, first: str, second: str, direction: Direction, *, connector: str = BRACE
    ) -> None:
        """A connector between the faces of two blocks that look the same way."""
        self.link(first, direction, second, direction, connector=connector)

    def link(
        self,
        first: str,
        way: Direction,
        second: str,
        other_way: Direction,
        *,
        connector: str = BRACE,
    ) -> None:
        self.do(
            "connect_blocks",
            block_a=first,
            face_a=self.face(first, way),
            block_b=second,
            face_b=self.face(second, other_way),
            connector=connector,
        )

    def aim(self, block: str, direction: Direction) -> None:
        """Twists a cannon or torch by quarter turns until it points a way."""
        for angle in (0, 90, 180, 270):
            trial = self.machine.copy()
            if angle and not trial.act("twist_block", {"block_id": block, "angle": angle}).ok:
                continue
            pointing = trial.blocks[block].pointing
            if pointing is not None and pointing @ np.array(direction, dtype=float) > 0.999:
                if angle:
                    self.do("twist_block", block_id=block, angle=angle)
                return
        raise ValueError(f"block {block} cannot point towards {direction}")

    def cannon(self, base: str, face: Direction, spray: Direction) -> str:
        made = self.attach(base, face, CANNON)
        self.aim(made, spray)
        return made

    def torch(self, base: str, face: Direction, flame: Direction) -> str:
        made = self.attach(base, face, TORCH)
        self.aim(made, flame)
        return made

    def wheel(self, base: str, face: Direction) -> str:
        """A wheel on an east or west face that rolls north when it spins forward."""
        made = self.attach(base, face, WHEEL)
        if face == WEST:
            self.do("flip_spin", block_id=made)
        return made

    def bind(self, block: str, action: str, key: str) -> None:
        self.do("add_control_key", block_id=block, action=action, new_key=key)

    def press(self, key: str, time: float, hold_for: float) -> None:
        self.do("add_control_sequence", time=time, key=key, hold_for=hold_for)


def assembled(logs: tuple[dict[str, Actions], Actions]) -> Machine:
    """The machine an assembly's logs build."""
    parts, actions = logs
    return replayed(actions, {name: replayed(part) for name, part in parts.items()})


def replayed(
    actions: Sequence[dict[str, Any]], available: dict[str, Machine] | None = None
) -> Machine:
    """The machine an action log builds; every action must be accepted."""
    machine = Machine(available=available) if available else Machine()
    for action in actions:
        outcome = machine.act(action["op"], action["params"])
        if not outcome.ok:
            raise ValueError(f"{action}: {outcome.text}")
    return machine
