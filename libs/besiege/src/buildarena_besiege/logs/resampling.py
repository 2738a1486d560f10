"""Series with irregular instants brought to the trajectory's own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError
from buildarena_simulation.constants import SAMPLE_RATE_HZ


def sample_instants(last_s: float) -> NDArray[np.float64]:
    """The trajectory's instants from 0 to a time, seconds."""
    return np.arange(math.floor(last_s * SAMPLE_RATE_HZ + 1e-6) + 1) / SAMPLE_RATE_HZ


def resampled(
    instants: NDArray[np.float64], time_s: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Values (M, C) at times (M,) interpolated to instants (T,): (T, C)."""
    columns = [np.interp(instants, time_s, values[:, i]) for i in range(values.shape[1])]
    return np.stack(columns, axis=1)


def stacked(series: list[NDArray[np.float64]], empty: tuple[int, ...]) -> NDArray[np.float64]:
    """Series (T, 3) of N blocks as (T, N, 3); of no blocks zeros of the shape given."""
    return np.stack(series, axis=1) if series else np.zeros(empty)


def latest(
    instants: NDArray[np.float64], time_s: NDArray[np.float64], values: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Of values (M,) at times (M,) the last one at each instant, or the first: (T,)."""
    at = np.searchsorted(time_s, instants + 1e-9, side="right") - 1
    return np.asarray(values[np.maximum(at, 0)])


def require_no_gap(
    time_s: NDArray[np.float64], *, name: str, longest_s: float, first_s: float, last_s: float
) -> float:
    """The longest time between two neighbours of a series, seconds.

    Args:
        time_s: (M,) increasing, seconds.
        name: What the series is of.
        longest_s: The longest time that is accepted.
        first_s: Where the series should begin.
        last_s: Where it should end.

    Raises:
        LogIncompleteError: Two neighbours are farther apart.
    """
    bounds = np.concatenate([[first_s], time_s, [last_s]])
    gaps = np.diff(bounds)
    worst = int(gaps.argmax())
    if gaps[worst] > longest_s + 1e-9:
        raise LogIncompleteError(
            f"Between {bounds[worst]:.2f} s and {bounds[worst + 1]:.2f} s nothing is told of "
            f"{name}; gaps of up to {longest_s:g} s are filled."
        )
    return float(gaps[worst])
