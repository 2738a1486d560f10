"""What a scorer says of one trial."""

from collections.abc import Mapping
from dataclasses import dataclass, field

Metric = float | int | bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A scorer's finding; fields as in `Score`, metrics without the machine's own."""

    success: bool
    indicator: float
    metrics: Mapping[str, Metric] = field(default_factory=dict)
    flags: tuple[str, ...] = ()


def rounded(value: float) -> float:
    """A metric to six decimals, so that scores compare equal across machines."""
    return round(float(value), 6) + 0.0  # no -0.0
