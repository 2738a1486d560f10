"""Errors between a submission and its score, and in stored data."""

from __future__ import annotations

from collections.abc import Sequence

from buildarena_benchmark import ValidationIssue


class PipelineError(Exception):
    """Base of all errors that the pipeline raises itself."""


class StartupError(PipelineError):
    """A process can't start; the message is one sentence with the reason and the remedy."""


class TransientError(PipelineError):
    """An infrastructure fault that another attempt may not meet: never scored, retryable.

    Attributes:
        reason: Its class, for example ``provider_outage``.
        delay_s: Wait before the next attempt; doubles with each fault in a row.
        endless: Whether the job waits without a limit, as the fault is not the job's.
    """

    def __init__(
        self, message: str, *, reason: str, delay_s: float = 0.0, endless: bool = False
    ) -> None:
        super().__init__(message)
        self.reason = reason
        self.delay_s = delay_s
        self.endless = endless


class PermanentError(PipelineError):
    """An infrastructure fault that no other attempt can fix: the job ends as errored.

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


class StoreError(Exception):
    """Base of all errors that the store raises itself."""


class UnknownIdError(StoreError):
    """No row has the id that was asked for."""

    def __init__(self, kind: str, id_: str) -> None:
        super().__init__(f"unknown {kind} {id_!r}")
        self.kind = kind


class RefusedError(StoreError):
    """A request that the present state does not permit; nothing was changed.

    Attributes:
        code: Why, in the words of the API's error codes.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class StaleLeaseError(RefusedError):
    """A write came from an owner whose lease on the job is over; nothing was written."""

    def __init__(self, job_id: str, token: int) -> None:
        super().__init__(
            "lease_ended", f"lease {token} on job {job_id} is over; its write was refused"
        )


class ArtifactMissingError(StoreError):
    """The artifact store does not hold the bytes of a hash."""


class ArtifactDamagedError(StoreError):
    """The bytes under a hash in the artifact store are damaged: restore them from a backup."""


class ArtifactStoreError(StoreError):
    """The artifact store can't be written or read now: full, out of reach, or not permitted."""


class UploadError(RefusedError):
    """A file or outcome that does not match its trial or its description; it does not count."""

    def __init__(self, message: str) -> None:
        super().__init__("upload_refused", message)


class SchemaVersionError(StoreError):
    """The database's schema is not the one this code was written for."""
