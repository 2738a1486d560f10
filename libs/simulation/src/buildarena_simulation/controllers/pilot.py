"""Who acts in a trial, a program or somebody outside: at every tick it is told, and asks."""

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
from buildarena_simulation.controllers.senses import Seen, Sensing
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.trajectory import Piloting

_NAME: Final = re.compile(r"\w+")

CONTROLLER: Final = "controller"
"""Where a trajectory's settings keep which program acted."""


def controller_digest(text: str) -> str:
    """SHA-256 of a program, as a trajectory's settings keep it."""
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()


class Pilot:
    """What a machine senses in a trial, and what is asked of it, tick after tick.

    Args:
        structure: The machine.
        bindings: The actions of each part.
        ids: Ids of the parts.
        scenario: What the machine is put through.
        sensors: Ids of further blocks that are told of.
        seed: Of the noise.

    Attributes:
        layout: The names of what it senses, as `Program.senses_are` takes them.
        sensing: What makes its senses.
        channels: What may be asked of it.
        sense_names: The same as a trajectory has them, in the order of the numbers.
        axes: See `Channels.axes`.

    Raises:
        ControllerFailed: The machine has no such block, or the scenario offers no senses.
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

    def senses(self, seen: Seen) -> list[float]:
        """What is sensed at a tick, to be read once in each."""
        return self.sensing.read(seen)

    def levels(
        self, values: Sequence[float], answers: Mapping[str, float]
    ) -> dict[tuple[int, str], float]:
        """What is asked for until the next tick; see `Channels.levels`.

        Args:
            values: What was sensed.
            answers: What was answered to it.

        Raises:
            ControllerFailed: There is no such action.
        """
        levels = self.channels.levels(answers)
        self._sensed.append(list(values))
        self._asked.append(levels)
        self._note({key for key, share in levels.items() if share > 0})
        self._tick += 1
        return levels

    def holds(self) -> list[KeyHold]:
        """When each action was asked for, as holds of a key of its own, see `channel`."""
        lasting = (self._hold(key, since) for key, since in self._since.items())
        return sorted([*self._holds, *lasting], key=lambda hold: (hold.time_s, hold.key))

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
        """What a trajectory keeps of who acts; of one outside nothing beside `piloting`."""
        return {}

    def _note(self, asked: set[tuple[int, str]]) -> None:
        for key in [key for key in self._since if key not in asked]:
            self._holds.append(self._hold(key, self._since.pop(key)))
        for key in asked:
            self._since.setdefault(key, self._tick / SAMPLE_RATE_HZ)

    def _hold(self, key: tuple[int, str], since: float) -> KeyHold:
        """An action that was asked for until now."""
        return KeyPress(
            time_s=round(since, 6),
            key=self.channels.names[key],
            hold_for_s=round(self._tick / SAMPLE_RATE_HZ - since, 6),
        )


class ProgramPilot(Pilot):
    """A program that acts.

    Args:
        text: The program.
        structure: See `Pilot`, as the others.
        bindings: The actions of each part.
        ids: Ids of the parts.
        scenario: What the machine is put through.
        seed: Of the program's random numbers and of the noise.

    Attributes:
        program: The program.

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
        _require_senses(scenario)
        self._text = text
        self.program = Program(text, seed=seed)
        super().__init__(structure, bindings, ids, scenario, self.program.sensors, seed=seed)
        self.program.senses_are(self.layout)

    def answered(self, seen: Seen) -> dict[tuple[int, str], float]:
        """What it asks for until the next tick; see `Channels.levels`.

        Raises:
            ControllerFailed: It fails, takes too much, or names an action that there is not.
        """
        return self.answered_to(self.senses(seen), seen.time_s)

    def answered_to(self, values: list[float], time_s: float) -> dict[tuple[int, str], float]:
        """The same where these are its senses, in the order of the layout."""
        return self.levels(values, self.program.answer(self._tick, time_s, values))

    def settings(self) -> dict[str, str]:
        """Which program acted."""
        return {CONTROLLER: controller_digest(self._text)}


def named_in(text: str, names: Iterable[str]) -> list[str]:
    """Those senses of whose names every part stands in a program's text."""
    words = set(_NAME.findall(text))
    return [name for name in names if words.issuperset(_NAME.findall(name))]


def _require_senses(scenario: Scenario) -> None:
    if scenario.senses is None or scenario.control.mode != "agent":
        raise ControllerFailed("this trial offers no senses: it takes keys alone")


def _flat(layout: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """The names of all numbers of a layout, which counts them in this order."""
    for name, what in layout.items():
        if isinstance(what, Mapping):
            yield from _flat(what, f"{path}{name}.")
        else:
            yield f"{path}{name}"
