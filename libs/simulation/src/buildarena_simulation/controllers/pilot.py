"""Interface between a trial and its controller, a program or an external one, at every tick."""

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from buildarena_geometry.blocks import KeyPress
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.control import Bindings, KeyHold
from buildarena_simulation.controllers.answers import Channels
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.controllers.senses import Sensing, Snapshot
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.trajectory import Piloting

_NAME: Final = re.compile(r"\w+")

CONTROLLER: Final = "controller"
"""Key of the program's digest in a trajectory's settings."""


def controller_digest(text: str) -> str:
    """Return SHA-256 of a program, as a trajectory's settings keep it."""
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()


class Pilot:
    """Senses of a machine in a trial, and the commands to it, tick after tick.

    Args:
        bindings: Keys of each part's actions.
        sensors: Ids of further blocks to sense.
        seed: Seed of the noise.

    Attributes:
        layout: Names of the senses, in the form of `Program.senses_are`.
        sensing: Source of the senses.
        channels: Actions that can be commanded.
        sense_names: Names of the senses in a trajectory, in the order of their values.
        axes: See `Channels.axes`.

    Raises:
        ControllerFailed: A sensor block is unknown, or the scenario offers no senses.
    """

    def __init__(
        self,
        structure: Structure,
        bindings: Bindings,
        ids: Sequence[str],
        scenario: Scenario,
        sensors: Sequence[str] = (),
        *,
        seed: int,
    ) -> None:
        _require_senses(scenario)
        self.sensing = Sensing(structure, scenario, sensors, seed=seed)
        self.channels = Channels(structure, bindings, ids)
        self.layout = self.sensing.layout
        self.sense_names = tuple(_flat(self.layout))
        self.axes = self.channels.axes()
        self._tick = 0
        self._since: dict[tuple[int, str], float] = {}
        self._holds: list[KeyHold] = []
        self._sensed: list[list[float]] = []
        self._asked: list[dict[tuple[int, str], float]] = []

    def senses(self, snapshot: Snapshot) -> list[float]:
        """Return the senses at a tick; call it once in each."""
        return self.sensing.read(snapshot)

    def levels(
        self, values: Sequence[float], answers: Mapping[str, float]
    ) -> dict[tuple[int, str], float]:
        """Return the levels until the next tick; see `Channels.levels`.

        Args:
            values: Senses at the tick.
            answers: Answers to them.

        Raises:
            ControllerFailed: An action is unknown.
        """
        levels = self.channels.levels(answers)
        self._sensed.append(list(values))
        self._asked.append(levels)
        self._note({key for key, share in levels.items() if share > 0})
        self._tick += 1
        return levels

    def holds(self) -> list[KeyHold]:
        """Return the periods of each action as holds of a separate key, see `channel`."""
        lasting = (self._hold(key, since) for key, since in self._since.items())
        return sorted([*self._holds, *lasting], key=lambda hold: (hold.time_s, hold.key))

    def piloting(self) -> Piloting:
        """Return senses and commands at every instant of the trial, including the last one."""
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
        """Return a trajectory's settings on the controller; empty for an external one."""
        return {}

    def _note(self, asked: set[tuple[int, str]]) -> None:
        for key in [key for key in self._since if key not in asked]:
            self._holds.append(self._hold(key, self._since.pop(key)))
        for key in asked:
            self._since.setdefault(key, self._tick / SAMPLE_RATE_HZ)

    def _hold(self, key: tuple[int, str], since: float) -> KeyHold:
        """Return the hold of an action that is active until now."""
        return KeyPress(
            time_s=round(since, 6),
            key=self.channels.names[key],
            hold_for_s=round(self._tick / SAMPLE_RATE_HZ - since, 6),
        )


class ProgramPilot(Pilot):
    """A controller that is a program.

    Args:
        structure: See `Pilot`, as for the others.
        bindings: Keys of each part's actions.
        seed: Seed of the program's random numbers and of the noise.

    Raises:
        ControllerFailed: The program cannot be read, names an unknown block, or the
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
        _require_senses(scenario)
        self._text = text
        self.program = Program(text, seed=seed)
        super().__init__(structure, bindings, ids, scenario, self.program.sensors, seed=seed)
        self.program.senses_are(self.layout)

    def answer(self, snapshot: Snapshot) -> dict[tuple[int, str], float]:
        """Run the program, and return the levels until the next tick; see `Channels.levels`.

        Raises:
            ControllerFailed: It fails, exceeds a limit, or names an unknown action.
        """
        return self.answer_senses(self.senses(snapshot), snapshot.time_s)

    def answer_senses(self, values: list[float], time_s: float) -> dict[tuple[int, str], float]:
        """Run the program on the given senses, in the layout's order, and return the levels."""
        return self.levels(values, self.program.answer(self._tick, time_s, values))

    def settings(self) -> dict[str, str]:
        """Return the digest of the program."""
        return {CONTROLLER: controller_digest(self._text)}


def find_names(text: str, names: Iterable[str]) -> list[str]:
    """Return the senses whose names occur in a program's text with all their parts."""
    identifiers = set(_NAME.findall(text))
    return [name for name in names if identifiers.issuperset(_NAME.findall(name))]


def _require_senses(scenario: Scenario) -> None:
    if scenario.senses is None or scenario.control.mode != "agent":
        raise ControllerFailed("this trial offers no senses: it takes keys alone")


def _flat(layout: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Yield the names of all numbers of a layout in order."""
    for name, item in layout.items():
        if isinstance(item, Mapping):
            yield from _flat(item, f"{path}{name}.")
        else:
            yield f"{path}{name}"
