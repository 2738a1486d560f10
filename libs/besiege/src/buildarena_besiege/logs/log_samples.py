"""From a log's lines to arrays: what is reported when, and what may be filled in."""

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
"""Versions of the lines that are read; those of the first do not say which level was open."""

LONGEST_GAP_S: Final = 0.2
"""From one known sample to the next; what lies between is filled in linearly.

What is missing at the end goes on as it went: a rocket that still rises would end too low.
"""

_POSITION: Final = slice(1, 4)
"""Of the six figures of a sample."""

LATEST_START_S: Final = 0.4
"""How late the first sample may be, where it shows that the trial began as it should."""


def require_whole(
    log: GameLog, machine: Machine, scenario: Scenario, tracked: tuple[str, ...]
) -> int:
    """Refuses logs that cannot be believed; how many key presses reached something."""
    begins = [line for line in log.lines if line.kind == "b"]
    if not begins:
        raise LogIncompleteError(f"The begin line of run {log.run_id} is missing.")
    if log.disputed:
        key = min(log.disputed)
        raise LogIncompleteError(
            f"Two different lines tell of the same moment, {key[1] / UPDATES_PER_S:.2f} s: "
            "none of them is believed."
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
    """What the game measured, for whoever compares it with ours."""
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
    """(T, count, 6) the log's values: 1, position, state, whether destroyed; NaN without any."""
    reported = np.full((scenario.sample_count, count, 6), np.nan)
    cargo = count if scenario.cargo is not None else None
    parts = max(-(-count // BLOCKS_PER_LINE), 1)
    for line in log.lines:
        if line.kind != "s":
            continue
        row, rest = divmod(line.update, SAMPLE_EVERY)
        if rest or row >= len(reported) or line.parts != parts or not _fits(line, count):
            raise LogIncompleteError(
                f"The line of {line.update / UPDATES_PER_S:.2f} s tells of other blocks or moments "
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
    wanted = range(first, min(first + BLOCKS_PER_LINE, count + 1))
    return [number for number, _ in line.entries] == list(wanted)


def filled(
    reported: NDArray[np.float64],
    known: NDArray[np.bool_],
    names: list[str],
    late: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], int]:
    """The reported values with short gaps filled, and the longest gap in samples."""
    whole, longest = reported.copy(), 0
    rows = np.arange(len(reported))
    most = round(LONGEST_GAP_S * SAMPLE_RATE_HZ)
    for column, name in enumerate(names):
        seen = np.flatnonzero(known[:, column])
        if not len(seen):
            raise LogIncompleteError(f"The log tells nothing of {name}.")
        # Nothing is reported of the start itself: the first sample is one interval later.
        bounds = np.concatenate([[0], seen, [len(reported) - 1]])
        gaps = np.diff(bounds)
        if late[column]:
            gaps[0] = min(gaps[0], most)
        worst = int(gaps.argmax())
        longest = max(longest, int(gaps[worst]), int(bounds[1]))
        if gaps[worst] > most:
            start, end = bounds[worst] / SAMPLE_RATE_HZ, bounds[worst + 1] / SAMPLE_RATE_HZ
            raise LogIncompleteError(
                f"Between {start:.2f} s and {end:.2f} s nothing is told of {name}; "
                f"gaps of up to {LONGEST_GAP_S:g} s are filled."
            )
        for component in range(1, reported.shape[2]):
            whole[:, column, component] = np.interp(rows, seen, reported[seen, column, component])
        if len(seen) > 1:
            before, last = reported[seen[-2:], column, _POSITION]
            speed = (last - before) / (seen[-1] - seen[-2])
            lacking = rows[seen[-1] + 1 :]
            whole[lacking, column, _POSITION] += np.outer(lacking - seen[-1], speed)
    return whole, longest


def first_seen(
    reported: NDArray[np.float64], known: NDArray[np.bool_]
) -> list[tuple[int, NDArray[np.float64]] | None]:
    """Of each column the first sample that is known and late, with its position; else None."""
    first: list[tuple[int, NDArray[np.float64]] | None] = []
    for column in range(known.shape[1]):
        seen = np.flatnonzero(known[:, column])
        late = len(seen) and LONGEST_GAP_S < seen[0] / SAMPLE_RATE_HZ <= LATEST_START_S + 1e-9
        first.append((int(seen[0]), reported[seen[0], column, 1:4]) if late else None)
    return first


def latest(values: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Each column's values, where not known the last known one, or the first."""
    held = np.zeros(values.shape)
    rows = np.arange(len(values))
    for column in range(values.shape[1]):
        seen = np.flatnonzero(known[:, column])
        at = seen[np.maximum(np.searchsorted(seen, rows, side="right") - 1, 0)]
        held[:, column] = values[at, column]
    return held


def reported_names(tracked: tuple[str, ...], scenario: Scenario) -> list[str]:
    """What messages call the reported blocks."""
    cargo = ["the cargo"] if scenario.cargo is not None else []
    return [*(f"block {block}" for block in tracked), *cargo]
