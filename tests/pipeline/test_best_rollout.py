"""Which of a job's rollouts counts."""

from __future__ import annotations

from datetime import UTC, datetime

from buildarena_benchmark import builtin_tasks
from buildarena_pipeline.runtime.scoring import best_rollout
from buildarena_store import RolloutRecord

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def rollout(number: int, *, success: bool, indicator: float, flags: tuple[str, ...] = ()):
    nothing = dict.fromkeys(RolloutRecord.__dataclass_fields__)
    given = {"number": number, "success": success, "indicator": indicator, "flags": flags}
    return RolloutRecord(**{**nothing, **given, "finished_at": NOW})


def test_an_honest_success_comes_first_then_the_larger_indicator(subtests) -> None:
    for rollouts, best in [
        ([(False, 90.0, ()), (True, 20.0, ())], 1),
        ([(True, 20.0, ()), (True, 30.0, ())], 1),
        ([(True, 20.0, ()), (True, 20.0, ())], 0),
        ([(True, 90.0, ("no_wheels",)), (True, 20.0, ())], 1),
        ([(True, 90.0, ("never_fell",)), (True, 20.0, ())], 0),
        ([(False, 9.0, ()), (True, 90.0, ("no_wheels",))], 1),
    ]:
        with subtests.test(rollouts=rollouts):
            made = [
                rollout(number, success=success, indicator=indicator, flags=flags)
                for number, (success, indicator, flags) in enumerate(rollouts)
            ]
            assert best_rollout(made, builtin_tasks()["transport-1"]).number == best
