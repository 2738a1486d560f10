"""The machine as its script sees it, in a rehearsal and in the simulation itself."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Final

from stand_in_game.frames import Array, swapped
from stand_in_game.machine_file import FileMachine
from stand_in_game.script import Script, ScriptError
from stand_in_game.trial import UPDATES_PER_S, Inputs, Part, Placed, holds

_UPDATES_PER_FRAME: Final = 2


class Stage:
    """What a script moves and sees.

    Args:
        file: the machine.
        part_at: a block of the file at a time.

    Attributes:
        update: how many fixed updates there have been.
        edges: keys pressed and let go: time, name in lower case, whether pressed.
        held: keys held now.
        masses: the cargo's mass after each update, from the start on.
    """

    def __init__(
        self, file: FileMachine, part_at: Callable[[int, float], Part], cargo: int | None
    ) -> None:
        self._file, self._part_at, self._cargo = file, part_at, cargo
        self.name = file.name
        self.update = 0
        self.edges: list[tuple[float, str, bool]] = []
        self.held: set[str] = set()
        mass = file.blocks[cargo].data.get("bmt-mass", 5.0) if cargo is not None else 5.0
        self._mass = float(mass) if isinstance(mass, int | float) else 5.0
        self.masses = [self._mass]
        self._places: dict[str, list[int]] = defaultdict(list)
        for place, block in enumerate(file.blocks):
            self._places[block.ref_key].append(place)

    @property
    def time_s(self) -> float:
        """Game time since the start, seconds."""
        return self.update / UPDATES_PER_S

    def places(self, ref_key: str) -> tuple[int, ...]:
        """The places of the blocks with a reference key."""
        return tuple(self._places.get(ref_key, ())) if ref_key else ()

    def block_count(self) -> int:
        """How many blocks the file has."""
        return len(self._file.blocks)

    def block(self, place: int) -> Part:
        """A block as it is now."""
        return self._part_at(place, self.time_s)

    def press(self, key: str, down: bool) -> None:
        """Presses a key or lets it go."""
        self.edges.append((self.time_s, key, down))
        (self.held.add if down else self.held.discard)(key)

    def slide(self, place: int, slider: str, value: float) -> None:
        """Sets a slider; only the cargo's mass has an effect here."""
        if place == self._cargo and slider == "mass":
            self._mass = value

    def fixed_update(self, script: Script) -> None:
        """One more update of the script's physics clock."""
        self.update += 1
        script.call("fixed_update")
        self.masses.append(self._mass)


def rehearse(placed: Placed, *, duration_s: float) -> Inputs:
    """What a machine's script will do, by running it once with the machine at rest."""
    file = placed.file
    if file.script is None:
        return Inputs()
    built = [as_built(placed, place) for place in range(len(file.blocks))]
    stage = Stage(file, lambda place, _: built[place], placed.rebuilt.cargo)
    try:
        script = Script(file.script, stage, lambda _: None)
        script.call("play")
        for update in range(1, round(duration_s * UPDATES_PER_S) + 1):
            stage.fixed_update(script)
            if update % _UPDATES_PER_FRAME == 0:
                script.call("update")
                script.call("late_update")
    except ScriptError:
        # The simulation meets the same error and says so in the log; until then, all holds.
        pass
    return Inputs(presses=holds(stage.edges, duration_s), masses=tuple(stage.masses))


def as_built(placed: Placed, place: int) -> Part:
    """A block where it stands before the simulation."""
    block = placed.file.blocks[place]
    right, up, forward = (_plain(swapped(column)) for column in placed.axes(block).T)
    return Part(
        type_id=block.type_id,
        position=_plain(swapped(placed.root(block))),
        right=right,
        up=up,
        forward=forward,
    )


def _plain(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return (x, y, z)
