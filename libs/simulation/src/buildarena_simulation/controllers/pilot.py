"""A controller at work in a trial: at every tick it is told, and asks."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from buildarena_geometry.blocks import KeyPress
from buildarena_simulation.control import Bindings, KeyHold
from buildarena_simulation.controllers.answers import Channels
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.controllers.senses import TICK_S, Seen, Sensing
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.trajectory import Piloting

CONTROLLER: Final = "controller"
"""Where a trajectory's settings keep which program acted."""


def controller_digest(text: str) -> str:
    """SHA-256 of a program, as a trajectory's settings keep it."""
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()


class Pilot:
    """A program, a machine and a trial.

    Args:
        text: The program.
        structure: The machine.
        bindings: The actions of each part.
        ids: Ids of the parts.
        scenario: What the machine is put through.
        seed: Of the program's random numbers and of the noise.

    Attributes:
        program: The program.
        sensing: What it is told.
        channels: What it may ask for.

    Raises:
        ControllerFailed: The program cannot be read, names a block that there is not, or the
            scenario takes none.
    """

    def __init__(
        self,
        text: str,
        structure: Structure,
        bindings: Bindings,
        ids: Sequence[str],
        scenario: Scenario,
        *,
        seed: int,
    ) -> None:
        if scenario.senses is None or scenario.control.mode != "agent":
            raise ControllerFailed("this trial offers no senses: it takes keys alone")
        self._text = text
        self.program = Program(text, seed=seed)
        self.sensing = Sensing(structure, scenario, self.program.sensors, seed=seed)
        self.program.senses_are(self.sensing.layout)
        self.channels = Channels(structure, bindings, ids)
        self._tick = 0
        self._since: dict[tuple[int, str], float] = {}
        self._holds: list[KeyHold] = []
        self._sensed: list[list[float]] = []
        self._asked: list[dict[tuple[int, str], float]] = []

    def levels(self, seen: Seen) -> dict[tuple[int, str], float]:
        """What it asks for until the next tick; see `Channels.levels`.

        Raises:
            ControllerFailed: It fails, takes too much, or names an action that there is not.
        """
        return self.levels_of(self.sensing.read(seen), seen.time_s)

    def levels_of(self, values: list[float], time_s: float) -> dict[tuple[int, str], float]:
        """What it asks for where these are its senses, in the order of the layout; see `levels`."""
        levels = self.channels.levels(self.program.answer(self._tick, time_s, values))
        self._sensed.append(values)
        self._asked.append(levels)
        self._tick += 1
        self._note(time_s, {key for key, share in levels.items() if share > 0})
        return levels

    def holds(self) -> list[KeyHold]:
        """When each action was asked for, as holds of a key of its own, see `channel`."""
        self._note(self._tick * TICK_S, set())
        return sorted(self._holds, key=lambda hold: (hold.time_s, hold.key))

    @property
    def sense_names(self) -> tuple[str, ...]:
        """What each number that it senses is called."""
        return tuple(_flat(self.sensing.layout))

    def piloting(self) -> Piloting:
        """What it sensed and asked for at every instant of the trial, the last one too."""
        senses = self.sense_names
        asked = sorted({key for levels in self._asked for key in levels})
        count = len(self._sensed)
        sensed = np.full((count + 1, len(senses)), np.nan, dtype=np.float32)
        sensed[:count] = np.array(self._sensed).reshape(count, len(senses))
        answers = np.zeros((count + 1, len(asked)), dtype=np.float32)
        for row, levels in zip(answers, self._asked, strict=False):
            row[:] = [levels.get(key, 0.0) for key in asked]
        return Piloting(
            sense_names=senses,
            senses=sensed,
            action_names=tuple(self.channels.names[key] for key in asked),
            answers=answers,
        )

    def settings(self) -> dict[str, str]:
        """What a trajectory keeps of who acts."""
        return {CONTROLLER: controller_digest(self._text)}

    def _note(self, time_s: float, asked: set[tuple[int, str]]) -> None:
        for key in [key for key in self._since if key not in asked]:
            since = self._since.pop(key)
            self._holds.append(
                KeyPress(
                    time_s=round(since, 6),
                    key=self.channels.names[key],
                    hold_for_s=round(time_s - since, 6),
                )
            )
        for key in asked:
            self._since.setdefault(key, time_s)


def _flat(layout: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """The names of all numbers of a layout, which counts them in this order."""
    for name, what in layout.items():
        if isinstance(what, Mapping):
            yield from _flat(what, f"{path}{name}.")
        else:
            yield f"{path}{name}"
