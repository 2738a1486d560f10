"""What a scorer says of one trial."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Metric = float | int | bool | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Deciding:
    """What decided a trial, and until when.

    Attributes:
        samples: How many samples were looked at, from the first on.
        members: (T, N) the tracked blocks whose motion decides.
        cargo: Whether the cargo's motion does, too.
    """

    samples: int
    members: NDArray[np.bool_]
    cargo: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A scorer's finding; fields as in `Score`, metrics without the machine's own.

    Attributes:
        success: As in `Score`.
        indicator: As in `Score`.
        metrics: The category's secondary metrics.
        flags: As in `Score`.
        deciding: What decided it; None where everything did, to the end.
    """

    success: bool
    indicator: float
    metrics: Mapping[str, Metric] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    deciding: Deciding | None = None


def rounded(value: float) -> float:
    """A metric to six decimals, so that scores compare equal across machines."""
    return round(float(value), 6) + 0.0  # no -0.0
