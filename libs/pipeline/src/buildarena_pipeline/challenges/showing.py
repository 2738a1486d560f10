"""What of a package can be shown: its machines and its flight, in our frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege import BesiegeError, read_machine_file
from buildarena_besiege.logs.tracker_file import read_tracker_file
from buildarena_geometry import Machine
from buildarena_pipeline.challenges.findings import CheckFailed
from buildarena_pipeline.challenges.package import packed_package
from buildarena_pipeline.challenges.season import OrbitScore, Season
from buildarena_pipeline.challenges.trials import read_machine

MAX_PLACES: Final = 2000
"""Of a flight: what is longer is shown in even steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """Where the tracked block was; T samples.

    Attributes:
        time_s: (T,) seconds.
        places: (T, 3) world frame (x east, y north, z up), units.
        center: (3,) of the planet, world frame, units; None where it is not known.
    """

    time_s: NDArray[np.float64]
    places: NDArray[np.float64]
    center: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What of a package can be shown.

    Attributes:
        machines: By the names of their files.
        flight: Its flight; None where its season has none.
    """

    machines: Mapping[str, Machine]
    flight: Flight | None


def shown_package(data: bytes, season: Season) -> Shown:
    """What of a package can be shown that passed its season's checks.

    Args:
        data: Its ZIP file.
        season: Its season.

    Raises:
        CheckFailed: A file of it cannot be read: it was never checked, or is shown by another
            release.
    """
    files, rule = packed_package(data).files, season.score
    try:
        if not isinstance(rule, OrbitScore):
            names = [f"{task}.json" for task in rule.tasks]
            return Shown(
                machines={name: read_machine(files[name], name) for name in names}, flight=None
            )
        raw = rule.files.raw
        tracked = read_tracker_file(files[rule.files.trajectory])
        machine = read_machine_file(files[raw]).machine
    except (BesiegeError, KeyError) as error:
        raise CheckFailed(f"it cannot be shown: {error}") from error
    count = len(tracked.time_s)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MAX_PLACES)).round().astype(int))
    center = None if rule.center is None else _ours(np.array([rule.center]))[0].tolist()
    return Shown(
        machines={raw: machine},
        flight=Flight(
            time_s=tracked.time_s[chosen],
            places=_ours(tracked.position[chosen]),
            center=None if center is None else (center[0], center[1], center[2]),
        ),
    )


def _ours(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of the game, whose y points up, in the world frame, (N, 3)."""
    return places[:, [0, 2, 1]]
