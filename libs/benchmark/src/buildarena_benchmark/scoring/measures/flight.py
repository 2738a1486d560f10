"""Steady flight: upright, near its start, entirely in the air, with its cargo."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.measures.carrying import bears_cargo, is_airborne
from buildarena_benchmark.scoring.measures.components import Mask, joined_to_start
from buildarena_benchmark.scoring.measures.outline import lowest_points
from buildarena_benchmark.scoring.measures.series import starting_block, tilt_deg
from buildarena_benchmark.scoring.scorer import NOT_CARRIED, Flag
from buildarena_geometry import Machine
from buildarena_simulation import Trajectory

_BORNE_SHARE: Final = 0.8
_BORNE_SAMPLES: Final = 25
"""The cargo's support is averaged over a second: forces swing while a machine settles."""

NOT_AIRBORNE: Final = Flag(
    name="not_airborne",
    meaning="The machine was at its height, but touched the ground.",
)

NOT_RISEN: Final = Flag(
    name="not_risen",
    meaning="The starting block was at its height, but the machine did not rise to it: some of it "
    "stayed near the ground, or the block began high up.",
)


class FlightScoring(Document):
    """Thresholds of steady flight.

    Attributes:
        max_tilt_deg: Largest tilt of the starting block relative to the start, degrees.
        max_drift: Horizontal distance of the starting block from its start, units.
        min_clearance: Least height of the machine's lowest point above the ground, units.
        min_rise: Least height of the starting block above where it started, units.
    """

    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_drift: Threshold = 5.0
    min_clearance: Threshold = 0.0
    min_rise: Threshold = 0.0


@dataclass(frozen=True, slots=True)
class Flight:
    """A trial's flight, moment by moment.

    Attributes:
        path: (T, 3) centre of the starting block, units.
        tilt: (T,) of the starting block, degrees.
        drift: (T,) horizontal distance of the starting block from its start, units.
        clearance: (T,) height of the lowest point above the ground, units.
        joined: (T, N) bool, joined to the starting block.
        steady: (T,) bool, nearly upright and near its start.
        rules: (T,) bool by flag, whether its rule is kept.
    """

    path: NDArray[np.float64]
    tilt: NDArray[np.float64]
    drift: NDArray[np.float64]
    clearance: NDArray[np.float64]
    joined: Mask
    steady: Mask
    rules: Mapping[Flag, Mask]

    def holds(self, *, without: Flag | None = None) -> Mask:
        """Return whether it flies steadily by all rules, or by all but one, (T,)."""
        holds = self.steady
        for flag, mask in self.rules.items():
            if flag != without:
                holds = holds & mask
        return holds

    def flags(self, passes: Callable[[Mask], bool]) -> dict[Flag, bool]:
        """Return which single rule a trial failed by.

        Args:
            passes: Whether a trial passes that flies steadily at given moments.
        """
        failed = not passes(self.holds())
        return {flag: failed and passes(self.holds(without=flag)) for flag in self.rules}


def flight_of(scoring: FlightScoring, machine: Machine, trajectory: Trajectory) -> Flight:
    """Return the flight of a trial whose forces are known."""
    joined = joined_to_start(machine, trajectory)
    start = starting_block(machine, trajectory)
    path = trajectory.positions[:, start].astype(np.float64)
    tilt = tilt_deg(trajectory, start)
    drift = np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    clearance = lowest_points(machine, trajectory, joined)
    return Flight(
        path=path,
        tilt=tilt,
        drift=drift,
        clearance=clearance,
        joined=joined,
        steady=(tilt < scoring.max_tilt_deg) & (drift < scoring.max_drift),
        rules={
            NOT_AIRBORNE: is_airborne(machine, trajectory, joined),
            NOT_CARRIED: bears_cargo(trajectory, share=_BORNE_SHARE, samples=_BORNE_SAMPLES),
            NOT_RISEN: (clearance >= scoring.min_clearance)
            & (path[:, 2] - path[0, 2] >= scoring.min_rise),
        },
    )


def runs_of(holds: Mask) -> list[tuple[int, int]]:
    """Return the stretches in which something holds: first sample, and the one after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
