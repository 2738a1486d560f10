"""Conversion of a log's lines to arrays, with gaps filled within limits."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.exporting.script import BLOCKS_PER_LINE, SAMPLE_EVERY
from buildarena_besiege.keys import UPDATES_PER_S
from buildarena_besiege.logs.game_log import GameLog
from buildarena_besiege.logs.level_check import level_finding
from buildarena_besiege.logs.log_lines import Line
from buildarena_besiege.tracking import LINE_VERSION, run_digest
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.trajectory import Setting

READABLE: Final = (1, LINE_VERSION)
"""Supported versions of the lines; those of the first do not identify the open level."""

LONGEST_GAP_S: Final = 0.2
"""Maximum time between known samples; values in between are interpolated linearly.

Missing values at the end are extrapolated: a rocket that still rises would end too low.
"""

_POSITION: Final = slice(1, 4)
"""Slice of the position in the six figures of a sample."""

LATEST_START_S: Final = 0.4
"""Latest first sample, if it shows that the trial began correctly."""


def require_complete(
    log: GameLog, machine: Machine, scenario: Scenario, tracked: tuple[str, ...]
) -> int:
    """Refuse inconsistent logs, and return the number of effective key presses."""
    begins = [line for line in log.lines if line.kind == "b"]
    if not begins:
        raise LogIncompleteError(f"The begin line of run {log.run_id} is missing.")
    if log.disputed:
        key = min(log.disputed)
        raise LogIncompleteError(
            f"The log contains two conflicting lines for t = {key[1] / UPDATES_PER_S:.2f} s."
        )
    version, presses, digest = begins[0].fields
    if version not in READABLE:
        raise LogIncompleteError(f"The log is of format {version}, not {LINE_VERSION}.")
    if digest != run_digest(machine, scenario, tracked):
        raise LogIncompleteError("The log is of another machine or another scenario.")
    if not log.ended:
        raise LogIncompleteError(
            f"The end line is missing: the log ends at {log.time_s:.2f} s "
            f"of {scenario.duration_s:g} s."
        )
    if version >= LINE_VERSION:
        _require_level(log, scenario)
    return presses


def _require_level(log: GameLog, scenario: Scenario) -> None:
    if log.world is None:
        raise LogIncompleteError("The line about the level is missing.")
    finding = level_finding(log.world, scenario)
    if finding is not None:
        raise LogIncompleteError(f"Another level was open than the trial's: {finding}.")


def level_settings(log: GameLog) -> dict[str, Setting]:
    """Return the game's measurements for comparison with the engines'."""
    world = log.world
    if world is None:
        return {}
    ground = [height for height in world.ground if isinstance(height, float)]
    return {
        "measured_gravity": world.gravity,
        "measured_ground": max(ground, default=0.0),
        "measured_screen": "x".join(map(str, world.screen)),
    }


def log_samples(log: GameLog, scenario: Scenario, count: int) -> NDArray[np.float64]:
    """Return the log's values, (T, count, 6): 1, position, state, destroyed; NaN without any."""
    reported = np.full((scenario.sample_count, count, 6), np.nan)
    cargo = count if scenario.cargo is not None else None
    parts = max(-(-count // BLOCKS_PER_LINE), 1)
    for line in log.lines:
        if line.kind != "s":
            continue
        row, offset = divmod(line.update, SAMPLE_EVERY)
        if offset or row >= len(reported) or line.parts != parts or not _fits(line, count):
            raise LogIncompleteError(
                f"The line of {line.update / UPDATES_PER_S:.2f} s is of other blocks or moments "
                "than this machine's."
            )
        for number, entry in line.entries:
            gone = entry.state == "x"
            if gone and number == cargo:
                raise LogIncompleteError(
                    f"The game destroyed the cargo at {line.update / UPDATES_PER_S:.2f} s."
                )
            state = 0.0 if entry.state in {"-", "x"} else float(entry.state)
            reported[row, number - 1] = (1.0, *entry.position, state, float(gone))
    return reported


def _fits(line: Line, count: int) -> bool:
    first = (line.part - 1) * BLOCKS_PER_LINE + 1
    expected = range(first, min(first + BLOCKS_PER_LINE, count + 1))
    return [number for number, _ in line.entries] == list(expected)


def filled(
    reported: NDArray[np.float64],
    is_known: NDArray[np.bool_],
    names: list[str],
    late: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], int]:
    """Return the reported values with short gaps filled, and the longest gap in samples."""
    result, longest = reported.copy(), 0
    rows = np.arange(len(reported))
    limit = round(LONGEST_GAP_S * SAMPLE_RATE_HZ)
    for column, name in enumerate(names):
        marks = np.flatnonzero(is_known[:, column])
        if not len(marks):
            raise LogIncompleteError(f"The log contains nothing on {name}.")
        # Nothing is reported of the start itself: the first sample is one interval later.
        bounds = np.concatenate([[0], marks, [len(reported) - 1]])
        gaps = np.diff(bounds)
        if late[column]:
            gaps[0] = min(gaps[0], limit)
        worst = int(gaps.argmax())
        longest = max(longest, int(gaps[worst]), int(bounds[1]))
        if gaps[worst] > limit:
            start, end = bounds[worst] / SAMPLE_RATE_HZ, bounds[worst + 1] / SAMPLE_RATE_HZ
            raise LogIncompleteError(
                f"Between {start:.2f} s and {end:.2f} s nothing is reported of {name}; "
                f"gaps of up to {LONGEST_GAP_S:g} s are filled."
            )
        for component in range(1, reported.shape[2]):
            result[:, column, component] = np.interp(
                rows, marks, reported[marks, column, component]
            )
        if len(marks) > 1:
            before, last = reported[marks[-2:], column, _POSITION]
            speed = (last - before) / (marks[-1] - marks[-2])
            lacking = rows[marks[-1] + 1 :]
            result[lacking, column, _POSITION] += np.outer(lacking - marks[-1], speed)
    return result, longest


def find_first_known(
    reported: NDArray[np.float64], is_known: NDArray[np.bool_]
) -> list[tuple[int, NDArray[np.float64]] | None]:
    """Return each column's first known and late sample with its position, or None."""
    first: list[tuple[int, NDArray[np.float64]] | None] = []
    for column in range(is_known.shape[1]):
        rows = np.flatnonzero(is_known[:, column])
        late = len(rows) and LONGEST_GAP_S < rows[0] / SAMPLE_RATE_HZ <= LATEST_START_S + 1e-9
        first.append((int(rows[0]), reported[rows[0], column, 1:4]) if late else None)
    return first


def latest(values: NDArray[np.float64], is_known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return each column's values, unknown ones replaced by the last known one, or the first."""
    held = np.zeros(values.shape)
    rows = np.arange(len(values))
    for column in range(values.shape[1]):
        known_rows = np.flatnonzero(is_known[:, column])
        at = known_rows[np.maximum(np.searchsorted(known_rows, rows, side="right") - 1, 0)]
        held[:, column] = values[at, column]
    return held


def reported_names(tracked: tuple[str, ...], scenario: Scenario) -> list[str]:
    """Return the names of the reported blocks for messages."""
    cargo = ["the cargo"] if scenario.cargo is not None else []
    return [*(f"block {block}" for block in tracked), *cargo]
