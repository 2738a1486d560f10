"""Errors of the package: a machine's fault, a file's fault and an incomplete log stay apart."""

from __future__ import annotations


class BesiegeError(Exception):
    """Base of every error this package raises for its input."""


class MachineNotPlayableError(BesiegeError, ValueError):
    """The game cannot take the machine, so its trial fails; the message is a sentence."""


class MachineFileError(BesiegeError, ValueError):
    """The bytes are not a machine file of the game; the message says why."""


class LogIncompleteError(BesiegeError, ValueError):
    """A log is not of a whole trial; the message says what is missing."""
