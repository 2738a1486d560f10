"""Errors between a submission and its score, and in stored data."""

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


class StoreError(Exception):
    """Base of all errors that the store raises itself."""


class UnknownIdError(StoreError):
    """No row has the id that was asked for.

    Attributes:
        kind: What was looked for, for example ``job``.
    """

    def __init__(self, kind: str, id_: str) -> None:
        super().__init__(f"there is no {kind} {id_!r}")
        self.kind = kind


class EndedKeyError(StoreError):
    """A key that was revoked or has expired can't get another secret."""

    def __init__(self, key_id: str, state: str) -> None:
        super().__init__(f"key {key_id} is {state}: make a new one")


class TransitionError(StoreError):
    """A sweep or job is in a state that it may not leave for the one that was asked for."""

    def __init__(self, kind: str, id_: str, state: str, to: str) -> None:
        super().__init__(f"{kind} {id_} is {state}; it can't become {to}")


class NotOwnedError(StoreError):
    """Somebody would change what belongs to another key; nothing was changed."""

    def __init__(self, kind: str, id_: str) -> None:
        super().__init__(f"{kind} {id_} was submitted with another key; only an admin may")


class NameTakenError(StoreError):
    """A name belongs to the key, and is of the kind, that first used it; nothing was changed."""

    def __init__(
        self, kind: str, name: str, *, holder: str | None = None, like: str | None = None
    ) -> None:
        """Say why a name is not to be had.

        Args:
            kind: What was to be named.
            holder: The kind that has it, if that is another one.
            like: The name that is taken: this one, or one that looks like it.
        """
        whose = "belongs to the key that first used it"
        if holder is not None:
            whose = f"is the name of an {holder}" if holder == "agent" else f"is a {holder}'s name"
        if like is not None and like != name:
            whose = f"looks like {like!r}, which {whose}"
        super().__init__(f"the {kind} name {name!r} {whose}: choose another name")


class RequestReusedError(StoreError):
    """A request has the name of an earlier one that asked for something else."""


class TooManyFilesError(StoreError):
    """An owner has as many trials of files under way as one may have."""

    def __init__(self, most: int) -> None:
        super().__init__(
            f"{most} trials of files are under way, as many as one key may have: wait for some to "
            "end"
        )


class TooManyLeasesError(StoreError):
    """A key's runners have as many leases as they may."""

    def __init__(self, number: int, most: int) -> None:
        super().__init__(f"the key's runners have {number} leases, of {most} that they may have")


class StaleLeaseError(StoreError):
    """A write came from an owner whose lease on the job is over; nothing was written."""

    def __init__(self, job_id: str, token: int) -> None:
        super().__init__(f"lease {token} on job {job_id} is over; its write was refused")


class ArtifactMissingError(StoreError):
    """The artifact store does not hold the bytes of a hash."""


class ArtifactDamagedError(StoreError):
    """The bytes under a hash in the artifact store are damaged: restore them from a backup."""


class ArtifactStoreError(StoreError):
    """The artifact store can't be written or read now: full, out of reach, or not permitted."""


class UploadError(StoreError):
    """A piece or file was not received as its sender says; nothing of it counts."""


class SchemaVersionError(StoreError):
    """The database's schema is not the one this code was written for."""
