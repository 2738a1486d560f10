"""Report of a verification: comparisons and the resulting verdict."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.journal import Usage
from buildarena_backend.results.results import JobScore
from buildarena_backend.states import Verdict
from buildarena_backend.trials.trials import REFUSED, refused
from buildarena_benchmark import Score
from buildarena_benchmark.scoring.scorer import REFUTED
from buildarena_simulation import ControllerFailed
from buildarena_simulation.controllers.program import blames_clock

SCORED: Final = ("success", "indicator", "metrics", "flags")
"""Figures of a score that are compared."""
_TOKENS: Final = ("input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens")


class NotRepeatableError(Exception):
    """A job can't be made again here; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A comparison: what is stored, and what came out now.

    Attributes:
        name: What is compared.
        ok: Whether both are equal.
        kept: What is stored.
        found: What came out now.
        able: Whether, when they differ, a figure is wrong; otherwise it can't be said here.
        trial: Number of the rollout whose trajectory is wrong when they differ, if it is that.
    """

    name: str
    ok: bool
    kept: Any
    found: Any
    able: bool = True
    trial: int | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """Findings of a verification.

    Attributes:
        checks: Its comparisons.
    """

    checks: Sequence[Check]

    @property
    def verdict(self) -> Verdict:
        """True if all is equal, and if not, whether that refutes the job."""
        differing = [check for check in self.checks if not check.ok]
        if not differing:
            return Verdict.VERIFIED
        able = all(check.able for check in differing)
        return Verdict.REFUTED if able else Verdict.INCONCLUSIVE

    @property
    def refuted_trials(self) -> list[int]:
        """Numbers of the rollouts whose trajectories are not what they must be."""
        if self.verdict != Verdict.REFUTED:
            return []
        return sorted({c.trial for c in self.checks if not c.ok and c.trial is not None})

    def as_document(self) -> dict[str, Any]:
        """``{"ok", "verdict", "checks": [{"name", "ok", "kept", "found"}]}``."""
        verdict = self.verdict
        names = ("name", "ok", "kept", "found")
        checks = [{name: getattr(check, name) for name in names} for check in self.checks]
        return {"ok": verdict == Verdict.VERIFIED, "verdict": verdict, "checks": checks}


def broken_off(detail: str) -> Check:
    """Return the finding that a verification cannot be done."""
    return compare("replay", "the journal", detail, able=False)


def compare(
    name: str, kept: Any, found: Any, *, able: bool = True, trial: int | None = None
) -> Check:
    """Return a comparison; the arguments are the fields of `Check`."""
    return Check(name=name, ok=kept == found, kept=kept, found=found, able=able, trial=trial)


def failure_checks(
    name: str, versions: Mapping[str, Any], failure: str, trial: int | None
) -> list[Check]:
    """Return whether a machine's program failed as is stored: why, in which line, at which tick.

    Args:
        name: The rollout's.
        versions: Its own, of the simulator.
        failure: How it failed now; "" where it did not.
        trial: See `Check`.
    """
    stored = str(versions.get(REFUSED, ""))
    kept = stored if stored.startswith(ControllerFailed.BEGINNING) else ""
    found = refused(failure).get(REFUSED, "")
    if not kept and not found:
        return []
    able = not blames_clock(kept) and not blames_clock(found)
    return [compare(f"{name}: failure", kept, found, able=able, trial=trial)]


def score_checks(job: Job, counted: JobScore | Score) -> list[Check]:
    """Return whether a job's score is what its trials are worth."""
    return [compare(f"score: {n}", _scored(job, n), plain(getattr(counted, n))) for n in SCORED]


def usage_checks(job: Job, usage: Usage) -> list[Check]:
    """Return whether what a job took and cost is what its replies did."""
    checks = [
        compare(f"usage: {n}", getattr(job, n), getattr(usage, n)) for n in ("requests", *_TOKENS)
    ]
    checks.append(compare("usage: cost_usd", f"{job.cost_usd:f}", f"{usage.cost_usd:.6f}"))
    return checks


def plain(value: Any) -> Any:
    """Return a value as it comes back from JSON."""
    if isinstance(value, Mapping):
        value = dict(value)
    elif isinstance(value, tuple):
        value = list(value)
    return json.loads(json.dumps(value))


def _scored(job: Job, name: str) -> Any:
    """Return a figure of a job's score, without what an earlier verification added to it."""
    value = plain(getattr(job, name))
    return [flag for flag in value if flag != REFUTED.name] if name == "flags" else value
