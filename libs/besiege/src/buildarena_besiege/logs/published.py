"""Logs of the published runner (CSV) as trajectories.

How its numbers are written is learnt from the rows (`rows.py`). Where times have one decimal, two
or three samples carry one time; they are joined to their mean. The runner copied the whole log
window again and again, newest line first, and may have cleaned the file afterwards. A cut-off
position that looks like the cargo's mass is recognised by the mass that the ramp has then. The
first lines of a long run are often cut: where the rows after them show a fall from rest, it is
continued backwards.
"""

from __future__ import annotations

import hashlib
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.logs.log_samples import LONGEST_GAP_S
from buildarena_besiege.logs.rows import Row, RowFormat, learnt_format, lines_of
from buildarena_besiege.logs.trajectories import Samples, build_trajectory
from buildarena_besiege.names import CARGO_ID
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.control import reaching
from buildarena_simulation.scenario import Cargo


def sample_instants(last_s: float) -> NDArray[np.float64]:
    """Return the trajectory's instants from 0 to a time, seconds."""
    return np.arange(math.floor(last_s * SAMPLE_RATE_HZ + 1e-6) + 1) / SAMPLE_RATE_HZ


def resampled(
    instants: NDArray[np.float64], time_s: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the values (M, C) at times (M,) interpolated to instants (T,): (T, C)."""
    columns = [np.interp(instants, time_s, values[:, i]) for i in range(values.shape[1])]
    return np.stack(columns, axis=1)


def stacked(series: list[NDArray[np.float64]], empty: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the series (T, 3) of N blocks as (T, N, 3); of no blocks zeros of the shape given."""
    return np.stack(series, axis=1) if series else np.zeros(empty)


def latest(
    instants: NDArray[np.float64], time_s: NDArray[np.float64], values: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return the last of values (M,) at times (M,) at each instant, or the first: (T,)."""
    at = np.searchsorted(time_s, instants + 1e-9, side="right") - 1
    return np.asarray(values[np.maximum(at, 0)])


def require_no_gap(
    time_s: NDArray[np.float64], *, name: str, longest_s: float, first_s: float, last_s: float
) -> float:
    """Return the longest time between two neighbours of a series, seconds.

    Args:
        time_s: (M,) increasing, seconds.
        name: Name of the series.
        longest_s: Maximum accepted time, seconds.
        first_s: Expected beginning, seconds.
        last_s: Expected end, seconds.

    Raises:
        LogIncompleteError: Two neighbours are farther apart.
    """
    bounds = np.concatenate([[first_s], time_s, [last_s]])
    gaps = np.diff(bounds)
    worst = int(gaps.argmax())
    if gaps[worst] > longest_s + 1e-9:
        raise LogIncompleteError(
            f"Between {bounds[worst]:.2f} s and {bounds[worst + 1]:.2f} s nothing is reported of "
            f"{name}; gaps of up to {longest_s:g} s are filled."
        )
    return float(gaps[worst])


EARLY_END_S: Final = 1.0
"""Maximum missing time at the end, seconds: a published run ends by the wall clock."""

LATE_START_S: Final = 0.4
"""Latest beginning of a log whose first rows show the time before them, seconds."""

LATE_FALL_S: Final = 0.15
"""Latest beginning of a fall, seconds: the game's first steps take 0.065 s."""

_ROWS_OF_A_FALL: Final = 3
_FALL_MISFIT: Final = 0.01
_UPDATE_S: Final = 0.01
_JUMPING_SHARE: Final = 0.1

Floats = NDArray[np.float64]


@dataclass(slots=True)
class _BlockLog:
    """The rows of one block: distinct values by time label."""

    places: dict[int, dict[tuple[float, ...], None]] = field(
        default_factory=lambda: defaultdict(dict)
    )
    masses: dict[int, dict[float, None]] = field(default_factory=lambda: defaultdict(dict))
    burning: dict[int, bool] = field(default_factory=dict)


@dataclass(slots=True)
class _Log:
    """A log's rows by block, how they are written, and a sentence about an error among them."""

    form: RowFormat
    blocks: Mapping[str, _BlockLog]
    complaint: str

    def times(self, labels: Sequence[int]) -> Floats:
        """Return the labels as times, seconds."""
        return np.array(labels) * self.form.label_s


def published_trajectory(csv_text: str, machine: Machine, scenario: Scenario) -> Trajectory:
    """Return the trajectory in a log of the published runner.

    It may begin a little after the scenario does, and end a little before. Blocks it does not
    report are not tracked.

    Args:
        csv_text: Log: copies of the window one after the other, or cleaned.

    Raises:
        LogIncompleteError: It has gaps, ends too early, or belongs to another machine.
    """
    log = _read(csv_text)
    reported = log.blocks
    ids = tuple(block for block in machine.blocks if block in reported and reported[block].places)
    cargo = scenario.cargo
    names = [*ids, *([CARGO_ID] if cargo is not None else [])]
    _require_reported(log, names)
    last = max(max(reported[name].places) for name in names) * log.form.label_s
    end_s = min(round(last, 6), scenario.duration_s)
    if end_s < scenario.duration_s - EARLY_END_S:
        raise LogIncompleteError(
            f"The log ends at {end_s:g} s of {scenario.duration_s:g} s.{log.complaint}"
        )
    instants = sample_instants(end_s)
    late_s = 0.0
    series = {name: _Series(name, *_places(log, name)) for name in names}
    if cargo is not None:
        late_s = series[CARGO_ID].continue_fall(scenario.gravity, log.form)
    positions = {name: series[name].at(instants, end_s) for name in names}
    burning = [_burning(log, block, instants) for block in ids]
    samples = Samples(
        of_roots=False,  # the published evaluation judges the heights as they are logged
        block_ids=ids,
        positions=stacked([positions[block] for block in ids], (len(instants), 0, 3)),
        burning=np.array(burning, dtype=bool).reshape(len(ids), len(instants)).T,
        cargo=None if cargo is None else positions[CARGO_ID],
        mass=None if cargo is None else _mass(log, cargo, instants, late_s),
        settings={
            "effective_key_presses": len(
                reaching(
                    [block.bindings for block in machine.blocks.values()], machine.control_sequence
                )
            ),
            "longest_gap_s": round(max(block.longest_gap_s for block in series.values()), 6),
            "begins_at_s": late_s,
            "ends_at_s": end_s,
            "lag": "not told by the log",
            "blocks_not_ours": len(set(reported) - set(machine.blocks) - {CARGO_ID}),
            "log": hashlib.sha256(csv_text.encode("utf-8", "replace")).hexdigest()[:16],
        },
    )
    return build_trajectory(samples, machine, scenario, version="published")


def looks_published(text: str) -> bool:
    """Check if a text has rows like the published runner's logs."""
    form = learnt_format(lines_of(text))
    return any(form.row(line) is not None for line in lines_of(text))


@dataclass(slots=True)
class _Series:
    """Positions of a block over time.

    Attributes:
        time_s: (M,) increasing, seconds.
        values: (M, 3) Besiege's components, units.
        longest_gap_s: Longest time without a row, once it was resampled.
    """

    name: str
    time_s: Floats
    values: Floats
    longest_gap_s: float = 0.0

    def at(self, instants: Floats, end_s: float) -> Floats:
        """Return positions at the trajectory's instants, (T, 3).

        Raises:
            LogIncompleteError: A gap is too long.
        """
        self.longest_gap_s = require_no_gap(
            self.time_s,
            name=_title(self.name),
            longest_s=LONGEST_GAP_S,
            first_s=0.0,
            last_s=end_s,
        )
        return resampled(instants, self.time_s, self.values)

    def continue_fall(self, gravity: float, form: RowFormat) -> float:
        """Add the beginning of a fall from rest, if the rows begin late and show its rest.

        Args:
            gravity: Downward acceleration, units/s².
            form: Format with the precision of the rows.

        Returns:
            The time at which the rows begin, seconds.
        """
        first = float(self.time_s[0])
        beginning = slice(0, _ROWS_OF_A_FALL)
        since, height = self.time_s[beginning] - first, self.values[beginning, 1]
        if not LONGEST_GAP_S < first <= LATE_START_S or len(since) < _ROWS_OF_A_FALL:
            return first
        # height = start - speed * since - gravity / 2 * since²; both by least squares
        expected = height + gravity / 2 * since**2
        slope, start = np.polyfit(since, expected, 1)
        begun = first + float(slope) / gravity
        misfit = np.abs(start + slope * since - expected).max()
        early_s = max(form.label_s - _UPDATE_S, 0.0) / 2  # how far a time is off at most
        allowed = _FALL_MISFIT + 2 * form.rounding + early_s * abs(slope)
        if not -_UPDATE_S <= begun <= LATE_FALL_S or misfit > allowed:
            return first
        times = np.arange(math.ceil(first * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
        fallen = np.maximum(times - begun, 0.0) ** 2 - (first - begun) ** 2
        before = np.tile(self.values[0], (len(times), 1))
        before[:, 1] = start - gravity / 2 * fallen
        self.time_s = np.concatenate([times, self.time_s])
        self.values = np.concatenate([before, self.values])
        return first


def _require_reported(log: _Log, names: Sequence[str]) -> None:
    if not names:
        raise LogIncompleteError(f"The log contains no block of this machine.{log.complaint}")
    for name in names:
        if name not in log.blocks or not log.blocks[name].places:
            raise LogIncompleteError(f"The log contains nothing on {_title(name)}.{log.complaint}")
        _require_one_run(log, name)


def _read(text: str) -> _Log:
    """Return the rows of each block."""
    lines = list(lines_of(text))
    form = learnt_format(lines)
    blocks: dict[str, _BlockLog] = defaultdict(_BlockLog)
    for row in _trusted([row for row in map(form.row, lines) if row is not None]):
        block = blocks[row.name]
        if row.burning is not None:
            block.burning[row.label] = block.burning.get(row.label, False) or row.burning
        elif len(row.values) == 1:
            block.masses[row.label][row.values[0]] = None
        else:
            block.places[row.label][row.values] = None
    error = next((line for line in lines if "lua" in line.lower()), None)
    complaint = "" if error is None else f" It speaks of an error: {error[:200]!r}."
    return _Log(form, blocks, complaint)


def _trusted(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield the rows, without those that may have been cut at the edge of a copy of the window.

    In a file that was not cleaned each copy has the newest line first; its first and last lines
    count only if another place of the file has them whole.
    """
    times = [row.label for row in rows]
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
    first, last = min(times), max(times)
    for i, row in enumerate(rows):
        if i not in edges or row in inside or times[i] in {first, last}:
            yield row


def _require_one_run(log: _Log, name: str) -> None:
    limit = max(2, math.ceil(log.form.label_s * SAMPLE_RATE_HZ))
    for label, places in log.blocks[name].places.items():
        if len(places) > limit:
            raise LogIncompleteError(
                f"At {label * log.form.label_s:g} s the log has {len(places)} different positions "
                f"of {_title(name)}; one run prints at most {limit}."
            )
    if _jumps(log, name) > _JUMPING_SHARE:
        raise LogIncompleteError(
            f"{_title(name).capitalize()} is at different positions at the same times: the log "
            "is of several runs."
        )


def _jumps(log: _Log, name: str) -> float:
    """Return the share of time labels within which a block moves more than between labels."""
    _, means = _places(log, name)
    places = log.blocks[name].places
    spreads = np.array([np.ptp(list(places[label]), axis=0).max() for label in sorted(places)])
    steps = np.abs(np.diff(means, axis=0)).max(axis=1) if len(means) > 1 else np.zeros(0)
    around = np.maximum(np.append(steps, 0.0), np.append(0.0, steps))
    return float((spreads > 2 * around + 4 * log.form.rounding).mean())


def _places(log: _Log, name: str) -> tuple[Floats, Floats]:
    """Return times and mean positions of a block, in order of time."""
    places = log.blocks[name].places
    labels = sorted(places)
    return log.times(labels), np.array([np.mean(list(places[label]), axis=0) for label in labels])


def _burning(log: _Log, name: str, instants: Floats) -> NDArray[np.bool_]:
    burning = log.blocks[name].burning
    labels = sorted(burning)
    if not labels:
        return np.zeros(len(instants), dtype=bool)
    return latest(instants, log.times(labels), np.array([burning[label] for label in labels]))


def _mass(log: _Log, cargo: Cargo, instants: Floats, late_s: float) -> Floats:
    """Return the cargo's mass, (T,), from the rows that the scenario's ramp explains."""
    form, masses = log.form, {}
    margin_s = form.label_s / 2 + _UPDATE_S
    for label, printed in log.blocks[CARGO_ID].masses.items():
        time_s = label * form.label_s
        low, high = (
            cargo.mass_at(max(time_s + side * margin_s, 0.0)) + side * form.rounding
            for side in (-1.0, 1.0)
        )
        low, high = min(low, high), max(low, high)
        fitting = [mass for mass in printed if low <= mass <= high]
        if fitting:
            masses[label] = sum(fitting) / len(fitting)
    labels = sorted(masses)
    if not labels:
        raise LogIncompleteError("The log lacks the cargo's mass along the scenario's ramp.")
    times = log.times(labels)
    require_no_gap(
        times,
        name="the cargo's mass, as the scenario's ramp has it",
        longest_s=LONGEST_GAP_S,
        first_s=late_s if late_s > LONGEST_GAP_S else 0.0,
        last_s=float(instants[-1]),
    )
    values = np.array([[masses[label]] for label in labels])
    return resampled(instants, times, values)[:, 0]


def _title(name: str) -> str:
    return "the cargo" if name == CARGO_ID else f"block {name}"
