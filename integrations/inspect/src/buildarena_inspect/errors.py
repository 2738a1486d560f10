"""Errors of buildarena_inspect."""


class BuildarenaInspectError(Exception):
    """Base class of this package's errors."""


class LogError(BuildarenaInspectError, ValueError):
    """A log or sample that can't be used."""


class ChoiceError(BuildarenaInspectError, ValueError):
    """An unknown task argument or value; the message lists the choices."""


class UnguardedProgramError(BuildarenaInspectError):
    """An unguarded program, which its trials' processes would run again."""
