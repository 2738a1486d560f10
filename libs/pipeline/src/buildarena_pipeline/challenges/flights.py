"""Checks of a package's tracker file: one block, its whole flight, nothing that is no flight."""

from __future__ import annotations

from typing import Final

import numpy as np

from buildarena_besiege.errors import LogIncompleteError
from buildarena_besiege.importing.xml_file import FileMachine
from buildarena_besiege.logs.tracker_file import TrackerFile, read_tracker_file
from buildarena_pipeline.challenges.findings import CheckFailed
from buildarena_pipeline.challenges.machines import starting_guid
from buildarena_pipeline.challenges.season import TrackerRules

_SLOWED: Final = 0.8
"""A blow leaves at most this share of the speed; what keeps more of it has not hit anything."""
_SETTLED: Final = 1e-3


def read_flight(data: bytes, name: str) -> TrackerFile:
    """The flight of the package's tracker file.

    Raises:
        CheckFailed: It cannot be read, or was cut off.
    """
    try:
        return read_tracker_file(data)
    except LogIncompleteError as error:
        raise CheckFailed(f"{name}: {error}") from error


def require_target(flight: TrackerFile, raw: FileMachine, name: str) -> str:
    """The tracker followed the raw machine's starting block, and no other.

    Raises:
        CheckFailed: It followed another, or several.
    """
    guid = starting_guid(raw)
    for other, line in zip(flight.targets, flight.lines, strict=True):
        if other.lower() != guid.lower():
            raise CheckFailed(
                f"{name}: line {line} is of block {other[:40]}; the starting block is {guid[:40]}"
            )
    stated = flight.settings.get("target_guids", guid)
    if stated.lower() != guid.lower():
        raise CheckFailed(f"{name}: its comments name the target {stated[:40]}, not {guid[:40]}")
    if int(flight.blocks[0]) != len(raw.blocks):
        raise CheckFailed(
            f"{name}: at the start the machine has {flight.blocks[0]:g} blocks, not "
            f"{len(raw.blocks)}"
        )
    return f"all {len(flight.lines)} samples are of the starting block"


def require_sound(flight: TrackerFile, rules: TrackerRules, name: str) -> str:
    """The samples follow each other at the season's rate, and nothing heals.

    Raises:
        CheckFailed: They do not; the message names the line.
    """
    if len(flight.lines) < 2:  # noqa: PLR2004 - a flight has a beginning and an end
        raise CheckFailed(f"{name}: it has one sample, which is no flight")
    _require_everywhere(
        flight, np.diff(flight.index) == 1, name, "the number of its sample does not follow"
    )
    steps = np.diff(flight.time_s)
    _require_everywhere(flight, steps > 0, name, "time does not pass")
    _require_everywhere(
        flight,
        steps <= rules.longest_gap_s,
        name,
        f"{steps.max():.2f} s without a sample before it",
    )
    if flight.index[0] != 0 or flight.time_s[0] > rules.longest_gap_s:
        raise CheckFailed(
            f"{name}: it begins with sample {flight.index[0]:g} at {flight.time_s[0]:.2f} s: its "
            "beginning is missing"
        )
    rate = 1.0 / float(steps.mean())
    if abs(rate / rules.rate_hz - 1.0) > rules.rate_within:
        raise CheckFailed(f"{name}: it has {rate:.3g} samples a second, not {rules.rate_hz:g}")
    whole = flight.integrity
    if not ((whole >= 0.0) & (whole <= 1.0)).all():
        raise CheckFailed(f"{name}: machine_integrity is a share, from 0 to 1")
    _require_everywhere(
        flight, np.diff(whole) <= _SETTLED, name, "the machine is more whole than before"
    )
    return f"{len(steps) + 1} samples over {flight.time_s[-1]:.1f} s, {rate:.3g} a second"


def require_no_jump(flight: TrackerFile, rules: TrackerRules, name: str) -> str:
    """No step between samples is one that no thrust explains.

    From one step to the next a velocity may change by the largest acceleration; a blow may change
    it by more, if it takes speed away.

    Raises:
        CheckFailed: A step is a jump; the message names the line.
    """
    steps = np.diff(flight.time_s)
    velocity = np.diff(flight.position, axis=0) / steps[:, None]
    speed = np.linalg.norm(velocity, axis=1)
    before = np.vstack([np.zeros(3), velocity[:-1]])
    change = np.linalg.norm(velocity - before, axis=1)
    possible = rules.largest_acceleration * steps
    was = np.concatenate([[0.0], speed[:-1]])
    is_jump = (change > possible) & (speed > _SLOWED * was)
    if is_jump.any():
        k = int(np.argmax(is_jump))
        raise CheckFailed(
            f"{name}: line {flight.lines[k + 1]} is a jump: the velocity changes by "
            f"{change[k]:.4g} units/s in {steps[k]:.2g} s, and no thrust exceeds "
            f"{rules.largest_acceleration:g} units/s²"
        )
    return f"the largest acceleration is {float((change / steps).max()):.3g} units/s²"


def _require_everywhere(flight: TrackerFile, holds: np.ndarray, name: str, fault: str) -> None:
    if not holds.all():
        raise CheckFailed(f"{name}: line {flight.lines[int(np.argmin(holds)) + 1]}: {fault}")
