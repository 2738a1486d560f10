"""Errors of buildarena_benchmark.environment: a caller's faults, and processes that end."""


class BuildarenaEnvironmentError(Exception):
    """Base of every error this package raises."""


class UnknownChoiceError(BuildarenaEnvironmentError, ValueError):
    """A name that does not exist; the message lists those that do."""

    def __init__(self, kind: str, name: object, choices: object) -> None:
        listed = ", ".join(str(choice) for choice in choices)  # type: ignore[attr-defined]
        super().__init__(f"unknown {kind} {name!r}: choose from {listed}")


class EpisodeOverError(BuildarenaEnvironmentError):
    """The episode has ended, or its steps are used up."""


class NothingToSubmitError(BuildarenaEnvironmentError):
    """No machine exists, or several without an assembly."""


class SnapshotError(BuildarenaEnvironmentError, ValueError):
    """A document is not a state of this environment."""


class CallError(BuildarenaEnvironmentError, ValueError):
    """Text or arguments that are not a call of a tool."""
