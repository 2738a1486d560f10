"""The log of a headless game: BesiegeField's GameStat lines on its standard output.

Each line has all blocks in the order of the machine file, every 0.2 s. It has no time, no run and
no check sum, so the lines are taken in the order they come, each once.
"""

from __future__ import annotations

import hashlib
import math
import re
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.exporting.machine_file import parts_in_file_order
from buildarena_besiege.logs.resampling import resampled, sample_instants, stacked
from buildarena_besiege.logs.trajectories import Samples, made_trajectory
from buildarena_besiege.names import CARGO_ID
from buildarena_besiege.tracking import tracked_blocks
from buildarena_geometry.besiege_components import pose_from_besiege
from buildarena_geometry.rotations import NO_ROTATION, ORIGIN, SHORTEST_QUATERNION

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_geometry.modules.module import Module
    from buildarena_simulation import Scenario, Trajectory

INTERVAL_S: Final = 0.2
"""Time from one line to the next, seconds."""

_BEGIN, _PRESS, _END = "SimulationStart", "PressKey", "SimulationEnd"
_STAT: Final = re.compile(r"GameStat:(.*)$")
_COMPLAINING: Final = re.compile(r"exception|error|crash", re.IGNORECASE)
_VALUES: Final = 8
_MAX_COMPLAINTS: Final = 50
_LONGEST_TAIL: Final = 1_000_000

Floats = NDArray[np.float64]
Row = tuple[tuple[str, tuple[float, ...]], ...]
"""Of each block its name, and position, rotation (x, y, z, w) and stress."""


class StateLog:
    """The game's standard output about one run, read bit by bit.

    Reading begins with the first start of a simulation and stops with its end.

    Args:
        run_id: The run's id, which the lines themselves do not have.
    """

    def __init__(self, run_id: str) -> None:
        self.run_id = run_id
        self.begun = False
        self.ended = False
        self._complaints: dict[str, None] = {}
        self._lines: list[str] = []
        self._rows: list[Row] = []
        self._presses = 0
        self._tail = ""

    def read(self, text: str) -> None:
        """Takes what the stream brought since the last time; cut anywhere."""
        *lines, tail = re.split(r"\r\n|\n", self._tail + text)
        self._tail = tail[-_LONGEST_TAIL:]
        for line in lines:
            self._take(line.strip(" \t\r\x00\ufeff"))

    @property
    def time_s(self) -> float:
        """How long the run has lasted by the number of lines, seconds."""
        return max(len(self._rows) - 1, 0) * INTERVAL_S

    @property
    def complaints(self) -> tuple[str, ...]:
        """Foreign lines that speak of an error."""
        return tuple(self._complaints)

    def text(self) -> str:
        """Every line that counts, in order; a log that reads it equals this one."""
        return "".join(f"{line}\n" for line in self._lines)

    def __eq__(self, other: object) -> bool:
        """Whether both hold the same lines of the same run."""
        if not isinstance(other, StateLog):
            return NotImplemented
        return self.run_id == other.run_id and self._lines == other._lines

    __hash__ = None  # type: ignore[assignment]  # it grows

    def trajectory(
        self, machine: Machine, scenario: Scenario, *, game: str, mod: str
    ) -> Trajectory:
        """The trajectory in the log; see `trajectory_of`.

        The mass of a cargo is not reported: it does not change in a game without a script. Whether
        cannons burn is not reported either.

        Raises:
            LogIncompleteError: Lines are missing, or are of another machine.
        """
        if not self.begun:
            raise LogIncompleteError("The log does not tell of a simulation's start.")
        expected = math.floor(scenario.duration_s / INTERVAL_S + 1e-6) + 1
        if len(self._rows) < expected - 1:  # the first line may be one interval late
            raise LogIncompleteError(
                f"The log ends after {self.time_s:.1f} s of {scenario.duration_s:g} s."
            )
        order = [part.id for part in parts_in_file_order(machine)]
        order += [CARGO_ID] if scenario.cargo is not None else []
        rows = self._rows[:expected]
        _require_blocks(rows, len(order))
        values = np.array([[entry[1] for entry in row] for row in rows], np.float64)
        time_s = np.arange(len(rows), dtype=np.float64) * INTERVAL_S
        instants = sample_instants(float(time_s[-1]))
        ids = tracked_blocks(machine, scenario)
        of_block = {part: values[:, i] for i, part in enumerate(order)}
        cargo = scenario.cargo
        samples = Samples(
            block_ids=ids,
            positions=stacked(
                [resampled(instants, time_s, of_block[block_id][:, :3]) for block_id in ids],
                (len(instants), 0, 3),
            ),
            burning=np.zeros((len(instants), len(ids)), dtype=bool),
            cargo=None if cargo is None else resampled(instants, time_s, of_block[CARGO_ID][:, :3]),
            mass=None if cargo is None else np.full(len(instants), cargo.initial_mass),
            quaternions=stacked(
                [
                    _turns(machine.blocks[block_id].module, of_block[block_id], instants)
                    for block_id in ids
                ],
                (len(instants), 0, 4),
            ),
            settings={
                "effective_key_presses": self._presses,
                "longest_gap_s": INTERVAL_S,
                "lag": "not told by the log",
                "cargo_mass": "not told by the log",
                "burning": "not told by the log",
                "run": hashlib.sha256(self.run_id.encode()).hexdigest()[:16],
                "log": hashlib.sha256(self.text().encode("utf-8", "replace")).hexdigest()[:16],
            },
        )
        return made_trajectory(samples, machine, scenario, version=f"{game}-{mod}")

    def _take(self, line: str) -> None:
        message = "BesiegeAgent" in line and "SendMessage:" in line
        if not message:
            if _COMPLAINING.search(line) and len(self._complaints) < _MAX_COMPLAINTS:
                self._complaints[line[:500]] = None
            return
        if self.ended:
            return
        if not self.begun:
            if _BEGIN in line:
                self.begun = True
                self._lines.append(line)
            return
        if match := _STAT.search(line):
            row = _row(match[1])
            if row is not None:
                self._rows.append(row)
                self._lines.append(line)
        elif _PRESS in line:
            self._presses += 1
            self._lines.append(line)
        elif _END in line:
            self.ended = True
            self._lines.append(line)


def _row(text: str) -> Row | None:
    """The blocks of a GameStat message; None if it is damaged. Goals are not blocks."""
    blocks = []
    for part in text.strip().strip("|").split("|"):
        name, _, numbers = part.partition(":")
        if name.startswith("GOAL_"):
            continue
        try:
            values = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            return None
        if len(values) != _VALUES or not all(map(math.isfinite, values)):
            return None
        blocks.append((name, values))
    return tuple(blocks) or None


def _require_blocks(rows: list[Row], count: int) -> None:
    for number, row in enumerate(rows):
        if len(row) != count:
            raise LogIncompleteError(
                f"The line of {number * INTERVAL_S:.1f} s tells of {len(row)} blocks; "
                f"the machine file has {count}."
            )


def _turns(module: Module, values: Floats, instants: Floats) -> Floats:
    """(T, 4) world_from_block of a block, of the nearest line."""
    series = np.zeros((len(values), 4))
    for i, (x, y, z, w) in enumerate(values[:, 3:7].tolist()):
        turn = (w, x, y, z) if math.hypot(w, x, y, z) > SHORTEST_QUATERNION else NO_ROTATION
        series[i] = pose_from_besiege(module, ORIGIN, turn).wxyz
    nearest = np.clip(np.rint(instants / INTERVAL_S).astype(int), 0, len(values) - 1)
    return np.asarray(series[nearest])
