"""Errors of buildarena_inspect."""


class BuildarenaInspectError(Exception):
    """Base of every error this package raises."""


class LogError(BuildarenaInspectError, ValueError):
    """A log, or a sample of it, can't be used; the message says which and why."""


class ChoiceError(BuildarenaInspectError, ValueError):
    """A task argument does not exist; the message lists the choices."""


class UnguardedProgramError(BuildarenaInspectError):
    """A program that starts evaluations is run again by the processes that they start."""
