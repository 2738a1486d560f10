"""What can go wrong between a submission and its score."""

from __future__ import annotations

from collections.abc import Sequence

from buildarena_benchmark import ValidationIssue


class PipelineError(Exception):
    """Base of all errors that the pipeline raises itself."""


class StartupError(PipelineError):
    """A process can't start; the message is one sentence that says why and what to do."""


class TransientError(PipelineError):
    """An infrastructure fault that another attempt may not meet: never scored, retryable.

    Attributes:
        reason: Its class, for example ``provider_outage``.
        delay_s: How long to wait before the next attempt; doubles with each fault in a row.
        endless: Whether the job waits however often it is met, as it is not the job's.
    """

    def __init__(
        self, message: str, *, reason: str, delay_s: float = 0.0, endless: bool = False
    ) -> None:
        super().__init__(message)
        self.reason = reason
        self.delay_s = delay_s
        self.endless = endless


class PermanentError(PipelineError):
    """An infrastructure fault that no other attempt can mend: the job ends as errored.

    Attributes:
        reason: Its class, for example ``bad_credentials``.
    """

    def __init__(self, message: str, *, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class SubmissionError(PipelineError):
    """A submission was refused; nothing of it was stored.

    Attributes:
        issues: Everything that is wrong with it.
    """

    def __init__(self, issues: Sequence[ValidationIssue]) -> None:
        super().__init__("; ".join(f"{issue.path}: {issue.message}" for issue in issues))
        self.issues = tuple(issues)
