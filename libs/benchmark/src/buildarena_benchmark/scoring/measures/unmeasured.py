"""Trials without forces: mechanisms and flight cannot be judged by positions alone."""

from buildarena_benchmark.scoring.scorer import FORCES_NOT_MEASURED, Verdict
from buildarena_simulation import Trajectory


def unmeasured(trajectory: "Trajectory", *, cargo: bool) -> Verdict | None:
    """Return a flagged failure for a trial that lacks what its scorer reads; None otherwise.

    Args:
        cargo: Whether the scorer reads the cargo.
    """
    lacks = trajectory.bearing is None or (cargo and trajectory.cargo_position is None)
    if not lacks:
        return None
    return Verdict(success=False, indicator=0.0, flags=(FORCES_NOT_MEASURED,))
