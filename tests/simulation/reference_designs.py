"""Reference machines of our own design: one function per family, each yielding an action log.

A log is a list of ``{"op": action, "params": arguments}``. Every design is parametric, so that
tests vary it, and good ones can serve as a scripted expert's repertoire.
"""

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


# Bridges


def beam(length: int = 7, braces: str = "", direction: Direction = NORTH) -> Actions:
    """A single row of blocks.

    Args:
        length: Odd number of blocks.
        braces: Which braces: "t" every seam on top, "b" below, "T" and "B" one from end to end,
            "1" and "2" overlapping ones of length 4 on top and below.
        direction: Where it runs.
    """
    draft = Draft()
    middle = draft.start()
    back = tuple(-d for d in direction)
    ahead = draft.row(middle, direction, length // 2)
    behind = draft.row(middle, back, length // 2)  # type: ignore[arg-type]
    row = [*reversed(behind), middle, *ahead]
    for kind in braces:
        way = UP if kind in "tT1" else DOWN
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        for first, second in zip(row, row[reach:], strict=False):
            draft.connect(first, second, way)
    return draft.actions


def deck(
    width: int = 5,
    length: int = 7,
    *,
    cross: bool = False,
    along: str = "",
    rails: bool = False,
    pillars: int = 0,
    pillar_at: Sequence[tuple[int, int]] = ((0, 1), (0, -1)),
) -> Actions:
    """A deck of rows along north-south that hang on one row along east-west.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        cross: Whether every east-west seam is braced on top.
        along: Braces along the rows, as in `beam`.
        rails: Whether three blocks stand at the middle of each long side.
        pillars: Height of the pillars below the deck; 0 for none.
        pillar_at: Where they are: row and block, counted from the middle.
    """
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    if rails:
        for x in (-(width // 2), width // 2):
            for y in (-1, 0, 1):
                draft.attach(grid[x, y], UP)
    for place in pillar_at if pillars else ():
        draft.row(grid[place], DOWN, pillars)
    if cross:
        _brace_grid(draft, grid, (1, 0), UP)
    for kind in along:
        reach = {"t": 1, "b": 1, "1": 4, "2": 4}.get(kind, length - 1)
        _brace_grid(draft, grid, (0, reach), UP if kind in "tT1" else DOWN)
    return draft.actions


def _deck_grid(draft: Draft, across: int, along: int) -> dict[tuple[int, int], str]:
    """Blocks of a deck by row and place, counted from the middle."""
    grid = {(0, 0): draft.start()}
    for sign, way in ((1, EAST), (-1, WEST)):
        for x, block in enumerate(draft.row(grid[0, 0], way, across), 1):
            grid[sign * x, 0] = block
    for x in range(-across, across + 1):
        for sign, way in ((1, NORTH), (-1, SOUTH)):
            for y, block in enumerate(draft.row(grid[x, 0], way, along), 1):
                grid[x, sign * y] = block
    return grid


def _brace_grid(
    draft: Draft, grid: dict[tuple[int, int], str], step: tuple[int, int], way: Direction
) -> None:
    """A brace from every block to the one a step further on."""
    for x, y in sorted(grid, key=lambda place: place[:: -1 if step[0] else 1]):
        further = grid.get((x + step[0], y + step[1]))
        if further is not None:
            draft.connect(grid[x, y], further, way)


def lattice(width: int, length: int, brace_count: int) -> Actions:
    """A plain deck with some of its east-west seams braced; for measurements of speed.

    Args:
        width: Odd number of rows.
        length: Odd number of blocks per row.
        brace_count: How many seams are braced.
    """
    draft = Draft()
    grid = _deck_grid(draft, width // 2, length // 2)
    seams = [(x, y) for x, y in sorted(grid) if (x + 1, y) in grid]
    for x, y in seams[:: len(seams) // brace_count][:brace_count]:
        draft.connect(grid[x, y], grid[x + 1, y], DOWN)
    return draft.actions


def one_shot_bridge() -> Actions:
    """The bridge of the paper's one-shot example, which is reported to carry 1000."""
    return deck(5, 7, cross=True, rails=True, pillars=5)


# Vehicles


def car(
    length: int = 5,
    track: int = 1,
    *,
    axles: int = 2,
    deck_half: tuple[int, int] | None = None,
    rails: bool = True,
    bound: bool = True,
    drive: Sequence[tuple[str, float, float]] = (("UpArrow", 1.0, 20.0),),
) -> Actions:
    """A spine along north-south with cross members, a wheel at each of their ends.

    UpArrow and DownArrow drive it, LeftArrow and RightArrow turn it on the spot.

    Args:
        length: Odd number of blocks in the spine.
        track: Blocks between the spine and a wheel.
        axles: Number of cross members, 2 or 3.
        deck_half: Half-width and half-length of a deck above it, in blocks; None for no deck.
        rails: Whether a rail runs round the deck.
        bound: Whether keys are bound to the wheels.
        drive: Key, time and duration of each press.
    """
    draft = Draft()
    middle = draft.start()
    front = draft.row(middle, NORTH, length // 2)[-1]
    back = draft.row(middle, SOUTH, length // 2)[-1]
    right, left = [], []
    for base in (front, back, middle)[:axles]:
        for side, wheels in ((EAST, right), (WEST, left)):
            end = ([base, *draft.row(base, side, track)])[-1]
            wheels.append(draft.wheel(end, side))
    if deck_half is not None:
        _deck_on(draft, middle, deck_half, rails=rails)
    if bound:
        for wheels, turn in ((right, "LeftArrow"), (left, "RightArrow")):
            back_turn = "RightArrow" if turn == "LeftArrow" else "LeftArrow"
            for wheel in wheels:
                draft.bind(wheel, "spinning_forward", "UpArrow")
                draft.bind(wheel, "spinning_backward", "DownArrow")
                draft.bind(wheel, "spinning_forward", turn)
                draft.bind(wheel, "spinning_backward", back_turn)
        for key, time, hold_for in drive:
            draft.press(key, time, hold_for)
    return draft.actions


def _deck_on(draft: Draft, base: str, half: tuple[int, int], *, rails: bool) -> None:
    across, along = half
    grid = {(0, 0): draft.attach(base, UP)}
    for sign, way in ((1, NORTH), (-1, SOUTH)):
        for y, block in enumerate(draft.row(grid[0, 0], way, along), 1):
            grid[0, sign * y] = block
    for y in range(-along, along + 1):
        for sign, way in ((1, EAST), (-1, WEST)):
            for x, block in enumerate(draft.row(grid[0, y], way, across), 1):
                grid[sign * x, y] = block
    if rails:
        for (x, y), block in grid.items():
            if abs(x) == across or abs(y) == along:
                draft.attach(block, UP)


def stool(height: int = 3) -> Actions:
    """A block with wheels lying flat on top: nothing that turns touches the ground."""
    draft = Draft()
    middle = draft.start()
    arms = [draft.row(middle, way, 2)[-1] for way in (EAST, WEST, NORTH, SOUTH)]
    for arm in arms:
        draft.row(arm, DOWN, height)
        wheel = draft.attach(arm, UP, WHEEL)
        draft.bind(wheel, "spinning_forward", "UpArrow")
    draft.press("UpArrow", 1.0, 20.0)
    return draft.actions


def cart() -> Actions:
    """Two driven wheels beside the starting block and a tail that drags on the ground."""
    draft = Draft()
    middle = draft.start()
    for side in (EAST, WEST):
        draft.bind(draft.wheel(middle, side), "spinning_forward", "UpArrow")
    draft.row(middle, SOUTH, 3)
    draft.press("UpArrow", 1.0, 20.0)
    return draft.actions


# Rockets

SIDES = (EAST, WEST, NORTH, SOUTH)


def rocket(
    sides: Sequence[Direction] = SIDES,
    *,
    heated: bool = True,
    cargo_blocks: int = 0,
    skew: bool = False,
) -> Actions:
    """Cannons round the starting block that spray down, each with a torch two blocks below.

    Args:
        sides: On which sides of the starting block a cannon sits.
        heated: Whether there are torches.
        cargo_blocks: Blocks on top, as dead weight.
        skew: Whether three blocks hang out to the east, so that it tips.
    """
    draft = Draft()
    middle = draft.start()
    for side in sides:
        draft.cannon(middle, side, DOWN)
    low = draft.row(middle, DOWN, 2)[-1]
    if heated:
        for side in sides:
            draft.torch(low, side, UP)
    top = draft.row(middle, UP, max(cargo_blocks, 1 if skew else 0))
    if skew:
        draft.row(top[-1], EAST, 3)
    for block in draft.machine.blocks.values():
        if block.module.kind == "cannon":
            draft.bind(block.id, "hold_to_fire", "Alpha1")
    return draft.actions


def paired_engine() -> Actions:
    """Two cannons side by side share one torch."""
    draft = Draft()
    middle = draft.start()
    draft.cannon(middle, EAST, DOWN)
    side = draft.attach(middle, NORTH)
    draft.cannon(side, EAST, DOWN)
    low = draft.row(middle, DOWN, 2)[-1]
    torch = draft.torch(low, EAST, UP)
    draft.do("shift_block", block_id=torch, shift_real=[0, 0.5, 0])
    for block in draft.machine.blocks.values():
        if block.module.kind == "cannon":
            draft.bind(block.id, "hold_to_fire", "Alpha1")
    return draft.actions


def waist_engine() -> Actions:
    """A cannon and a torch beside it whose flame is level with the cannon's narrow middle."""
    draft = Draft()
    middle = draft.start()
    cannon = draft.cannon(middle, EAST, DOWN)
    post = draft.row(middle, NORTH, 1)[-1]
    low = draft.row(post, DOWN, 1)[-1]
    torch = draft.torch(low, EAST, UP)
    # Flame a quarter off the cannon's side, at the height of its waist.
    draft.do("shift_block", block_id=torch, shift_real=[0, -0.25, -0.125])
    draft.bind(cannon, "hold_to_fire", "Alpha1")
    return draft.actions


def rocket_assembly(
    *, sides: Sequence[Direction] = SIDES, heated: bool = True
) -> tuple[dict[str, Actions], Actions]:
    """An engine under a cross-shaped frame: the sub-structures by name, and the assembly's log.

    Args:
        sides: On which sides of the engine's starting block a cannon sits.
        heated: Whether there are torches.
    """
    draft = Draft()
    middle = draft.start()
    for side in SIDES:
        draft.row(middle, side, 2)
    parts = {"engine": rocket(sides, heated=heated), "frame": draft.actions}
    whole = Draft({name: replayed(actions) for name, actions in parts.items()})
    whole.do("add_machine", machine_id="frame", init_shift=[0, 0, 2])
    whole.do("add_machine", machine_id="engine", init_shift=[0, 0, 0])
    for side in SIDES:
        whole.link("A_1", side, "B_1", UP)
    return parts, whole.actions


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
