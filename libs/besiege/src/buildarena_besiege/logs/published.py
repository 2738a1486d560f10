"""Logs of the published runner (CSV) as trajectories.

Its lines hold one decimal, time included, so two or three samples carry one time; they are joined
to their mean. It copied the whole log window again and again, newest line first, and may have
cleaned the file afterwards. A number always has exactly one decimal there, which is how cut-off
numbers are known; a cut-off position that looks like the cargo's mass is known by the mass that the
ramp has then.
"""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.logs.resampling import (
    latest,
    require_no_gap,
    resampled,
    sample_instants,
    stacked,
)
from buildarena_besiege.logs.trajectories import LONGEST_GAP_S, Samples, made_trajectory
from buildarena_besiege.names import CARGO_ID
from buildarena_simulation.control import effective_presses

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from buildarena_geometry import Machine
    from buildarena_simulation import Scenario, Trajectory
    from buildarena_simulation.scenario import Cargo

EARLY_END_S: Final = 1.0
"""A published run ends by the wall clock, so by the script's own time it may end early, seconds."""

_NUMBER: Final = re.compile(r"-?\d{1,7}\.\d", re.ASCII)
_NAME: Final = re.compile(r"ID_(.{1,100})")
_LINE_ENDS: Final = re.compile(r"\r\n|\r|\n")
_HALF_LABEL_S: Final = 0.06
_GRAIN: Final = 0.051
_JUMPING_SHARE: Final = 0.1
_PLACE_FIELDS: Final = 5
_STATE_FIELDS: Final = 3
_LONGEST_ROW: Final = 300
_SAMPLES_A_LABEL: Final = 3

Floats = NDArray[np.float64]
Row = tuple[str, ...]


@dataclass(slots=True)
class _BlockLog:
    """The rows of one block: distinct values by time label, in tenths of a second."""

    places: dict[int, dict[tuple[float, ...], None]] = field(
        default_factory=lambda: defaultdict(dict)
    )
    states: dict[int, dict[str, None]] = field(default_factory=lambda: defaultdict(dict))


def published_trajectory(csv_text: str, machine: Machine, scenario: Scenario) -> Trajectory:
    """The trajectory in a log of the published runner.

    It may end a little before the scenario does. Blocks it does not report are not tracked.

    Args:
        csv_text: The log: copies of the window one after the other, or cleaned.
        machine: The machine that was played.
        scenario: What it was put through.

    Raises:
        LogIncompleteError: It has gaps, ends too early, or is of another machine.
    """
    reported, complaint = _read(csv_text)
    ids = tuple(block for block in machine.blocks if block in reported and reported[block].places)
    cargo = scenario.cargo
    names = [*ids, *([CARGO_ID] if cargo is not None else [])]
    _require_reported(reported, names, complaint)
    end_s = min(max(max(reported[name].places) for name in names) / 10, scenario.duration_s)
    if end_s < scenario.duration_s - EARLY_END_S:
        raise LogIncompleteError(
            f"The log ends at {end_s:g} s of {scenario.duration_s:g} s.{complaint}"
        )
    instants = sample_instants(end_s)
    series = {name: _series(reported[name], name, instants, end_s) for name in names}
    burning = [_burning(reported[block], instants) for block in ids]
    samples = Samples(
        of_roots=False,  # the published evaluation judges the heights as they are logged
        block_ids=ids,
        positions=stacked([series[block][0] for block in ids], (len(instants), 0, 3)),
        burning=np.array(burning, dtype=bool).reshape(len(ids), len(instants)).T,
        cargo=None if cargo is None else series[CARGO_ID][0],
        mass=None if cargo is None else _mass(reported[CARGO_ID], cargo, instants),
        settings={
            "effective_key_presses": effective_presses(
                [block.bindings for block in machine.blocks.values()], machine.control_sequence
            ),
            "longest_gap_s": round(max(gap for _, gap in series.values()), 6),
            "ends_at_s": end_s,
            "lag": "not told by the log",
            "blocks_not_ours": len(set(reported) - set(machine.blocks) - {CARGO_ID}),
            "log": hashlib.sha256(csv_text.encode("utf-8", "replace")).hexdigest()[:16],
        },
    )
    return made_trajectory(samples, machine, scenario, version="published")


def _require_reported(reported: dict[str, _BlockLog], names: Sequence[str], complaint: str) -> None:
    if not names:
        raise LogIncompleteError(f"The log tells nothing of any block of this machine.{complaint}")
    for name in names:
        if name not in reported or not reported[name].places:
            raise LogIncompleteError(f"The log tells nothing of {_called(name)}.{complaint}")
        _require_one_run(reported[name], name)


def _series(
    block_log: _BlockLog, name: str, instants: Floats, end_s: float
) -> tuple[Floats, float]:
    """A block's positions at the trajectory's instants, and the longest gap, seconds."""
    time_s, values = _places(block_log)
    gap = require_no_gap(
        time_s, name=_called(name), longest_s=LONGEST_GAP_S, first_s=0.0, last_s=end_s
    )
    return resampled(instants, time_s, values), gap


def looks_published(text: str) -> bool:
    """Whether a text has rows as the published runner's logs do."""
    return any(_is_sound(row) for row in _rows(text))


def _read(text: str) -> tuple[dict[str, _BlockLog], str]:
    """The rows of each block, and a sentence about a Lua error among them."""
    rows = list(_rows(text))
    reported: dict[str, _BlockLog] = defaultdict(_BlockLog)
    for label, *fields in _trusted([row for row in rows if _is_sound(row)]):
        match = _NAME.fullmatch(fields[0])
        if match is None:
            continue
        time = round(float(label) * 10)
        if len(fields) == _PLACE_FIELDS - 1:
            reported[match[1]].places[time][tuple(map(float, fields[1:]))] = None
        else:
            reported[match[1]].states[time][fields[1]] = None
    errors = [row for row in rows if "lua" in ",".join(row).lower()]
    complaint = f" It speaks of an error: {', '.join(errors[0])[:200]!r}." if errors else ""
    return reported, complaint


def _rows(text: str) -> Iterator[Row]:
    for line in _LINE_ENDS.split(text):
        cut = line[: _LONGEST_ROW * 2].strip(" \t\ufeff\x00\xa0")
        if cut:
            yield tuple(part.strip(' \t"') for part in cut.split(","))


def _is_sound(row: Row) -> bool:
    """Whether every number of a row is whole."""
    if len(row) not in {_PLACE_FIELDS, _STATE_FIELDS} or not _NAME.fullmatch(row[1]):
        return False
    if len(row) == _STATE_FIELDS and row[2] in {"true", "false"}:
        return _NUMBER.fullmatch(row[0]) is not None
    return all(_NUMBER.fullmatch(part) for part in (row[0], *row[2:]))


def _trusted(rows: Sequence[Row]) -> Iterator[Row]:
    """The rows, without those that may have been cut at the edge of a copy of the window.

    In a file that was not cleaned each copy has the newest line first; its first and last lines
    count only if another place of the file has them whole.
    """
    times = [float(row[0]) for row in rows]
    rising = sum(later > earlier for earlier, later in pairwise(times))
    falling = sum(later < earlier for earlier, later in pairwise(times))
    if falling <= rising:
        yield from rows
        return
    edges = {0, len(rows) - 1}
    for i, (earlier, later) in enumerate(pairwise(times)):
        if later > earlier:
            edges |= {i, i + 1}
    inside = {row for i, row in enumerate(rows) if i not in edges}
    # A run's very first and last samples appear only at edges: they are kept where they fit in.
    least, most = min(times), max(times)
    for i, row in enumerate(rows):
        if i not in edges or row in inside or times[i] in {least, most}:
            yield row


def _require_one_run(block_log: _BlockLog, name: str) -> None:
    for label, places in block_log.places.items():
        if len(places) > _SAMPLES_A_LABEL:
            raise LogIncompleteError(
                f"At {label / 10:g} s the log has {len(places)} different positions of "
                f"{_called(name)}; one run prints at most {_SAMPLES_A_LABEL}."
            )
    if _jumps(block_log) > _JUMPING_SHARE:
        raise LogIncompleteError(
            f"{_called(name).capitalize()} is at different positions at the same times: the log "
            "is of several runs."
        )


def _jumps(block_log: _BlockLog) -> float:
    """The share of time labels within which a block moves more than from label to label."""
    _, means = _places(block_log)
    spreads = np.array(
        [np.ptp(list(block_log.places[label]), axis=0).max() for label in sorted(block_log.places)]
    )
    steps = np.abs(np.diff(means, axis=0)).max(axis=1) if len(means) > 1 else np.zeros(0)
    around = np.maximum(np.append(steps, 0.0), np.append(0.0, steps))
    return float((spreads > 2 * around + 4 * _GRAIN).mean())


def _places(block_log: _BlockLog) -> tuple[Floats, Floats]:
    """Times and mean positions of a block, in order of time."""
    labels = sorted(block_log.places)
    means = [np.mean(list(block_log.places[label]), axis=0) for label in labels]
    return np.array(labels) / 10, np.array(means)


def _burning(block_log: _BlockLog, instants: Floats) -> NDArray[np.bool_]:
    labels = sorted(
        label for label, states in block_log.states.items() if states.keys() & {"true", "false"}
    )
    if not labels:
        return np.zeros(len(instants), dtype=bool)
    burns = np.array(["true" in block_log.states[label] for label in labels])
    return latest(instants, np.array(labels) / 10, burns)


def _mass(cargo_log: _BlockLog, cargo: Cargo, instants: Floats) -> Floats:
    """(T,) the cargo's mass, of the rows that the scenario's ramp explains."""
    masses: dict[int, float] = {}
    for label, states in cargo_log.states.items():
        time_s = label / 10
        low, high = (
            cargo.mass_at(max(time_s + side * _HALF_LABEL_S, 0.0)) + side * _GRAIN
            for side in (-1.0, 1.0)
        )
        masses_of_label = [
            float(state)
            for state in states
            if _NUMBER.fullmatch(state) and min(low, high) <= float(state) <= max(low, high)
        ]
        if masses_of_label:
            masses[label] = sum(masses_of_label) / len(masses_of_label)
    labels = sorted(masses)
    if not labels:
        raise LogIncompleteError(
            "The log does not tell the cargo's mass as the scenario's ramp has it."
        )
    times = np.array(labels) / 10
    require_no_gap(
        times,
        name="the cargo's mass, as the scenario's ramp has it",
        longest_s=LONGEST_GAP_S,
        first_s=0.0,
        last_s=float(instants[-1]),
    )
    values = np.array([[masses[label]] for label in labels])
    return resampled(instants, times, values)[:, 0]


def _called(name: str) -> str:
    return "the cargo" if name == CARGO_ID else f"block {name}"
