"""Report of a verification: comparisons and the resulting verdict."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.journal import Usage
from buildarena_backend.results.results import JobScore
from buildarena_backend.states import Verdict
from buildarena_backend.trials.trials import REFUSED, refused
from buildarena_benchmark import Score
from buildarena_benchmark.scoring.flags import REFUTED
from buildarena_simulation import ControllerFailed
from buildarena_simulation.controllers.program import blames_clock

SCORED: Final = ("success", "indicator", "metrics", "flags")
"""Figures of a score that are compared."""
_TOKENS: Final = ("input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens")


@dataclass(frozen=True, slots=True)
class Check:
    """A comparison of a stored with a recomputed value.

    Attributes:
        name: Description of the value.
        fresh: Value of the repetition.
        able: Whether a difference refutes the job; otherwise it is inconclusive.
        trial: Number of the rollout whose trajectory is wrong when they differ, if any.
    """

    name: str
    stored: Any
    fresh: Any
    able: bool = field(default=True, kw_only=True)
    trial: int | None = field(default=None, kw_only=True)

    @property
    def ok(self) -> bool:
        """True if both values are equal."""
        return bool(self.stored == self.fresh)


@dataclass(frozen=True, slots=True)
class Report:
    """Findings of a verification."""

    checks: Sequence[Check]

    @property
    def verdict(self) -> Verdict:
        """The verdict: verified, refuted or inconclusive."""
        differing = [check for check in self.checks if not check.ok]
        if not differing:
            return Verdict.VERIFIED
        able = all(check.able for check in differing)
        return Verdict.REFUTED if able else Verdict.INCONCLUSIVE

    @property
    def refuted_trials(self) -> list[int]:
        """Numbers of the rollouts whose trajectories differ, if the job is refuted."""
        if self.verdict != Verdict.REFUTED:
            return []
        return sorted({c.trial for c in self.checks if not c.ok and c.trial is not None})

    def as_document(self) -> dict[str, Any]:
        """``{"ok", "verdict", "checks": [{"name", "ok", "kept", "found"}]}``."""
        verdict = self.verdict
        checks = [
            {"name": c.name, "ok": c.ok, "kept": c.stored, "found": c.fresh} for c in self.checks
        ]
        return {"ok": verdict == Verdict.VERIFIED, "verdict": verdict, "checks": checks}


def broken_off(detail: str) -> Check:
    """Return the finding that a verification cannot be done."""
    return Check("replay", "the journal", detail, able=False)


def failure_checks(
    name: str, versions: Mapping[str, Any], failure: str, trial: int | None
) -> list[Check]:
    """Compare the failure of a machine's program with the stored one: reason, line and tick.

    Args:
        name: Name of the rollout.
        versions: Versions of the rollout's simulator.
        failure: Failure in the repetition; "" without one.
        trial: See `Check`.
    """
    stored = str(versions.get(REFUSED, ""))
    stored = stored if stored.startswith(ControllerFailed.BEGINNING) else ""
    repeated = refused(failure).get(REFUSED, "")
    if not stored and not repeated:
        return []
    able = not blames_clock(stored) and not blames_clock(repeated)
    return [Check(f"{name}: failure", stored, repeated, able=able, trial=trial)]


def score_checks(job: Job, counted: JobScore | Score) -> list[Check]:
    """Compare a job's score with that of its trials."""
    return [Check(f"score: {n}", _scored(job, n), plain(getattr(counted, n))) for n in SCORED]


def usage_checks(job: Job, usage: Usage) -> list[Check]:
    """Compare a job's use and cost with those of its replies."""
    checks = [
        Check(f"usage: {n}", getattr(job, n), getattr(usage, n)) for n in ("requests", *_TOKENS)
    ]
    checks.append(Check("usage: cost_usd", f"{job.cost_usd:f}", f"{usage.cost_usd:.6f}"))
    return checks


def plain(value: Any) -> Any:
    """Return a value as it comes back from JSON."""
    return json.loads(json.dumps(value, default=dict))


def _scored(job: Job, name: str) -> Any:
    """Return a figure of a job's score, without the flag that an earlier verification added."""
    value = plain(getattr(job, name))
    return [flag for flag in value if flag != REFUTED.name] if name == "flags" else value
