"""Errors of the package: a machine's fault, a file's fault and an incomplete log."""

from __future__ import annotations


class BesiegeError(Exception):
    """Base of every error this package raises for its input."""


class MachineNotPlayableError(BesiegeError, ValueError):
    """The game cannot take the machine, so its trial fails; the message is a sentence."""


class MachineFileError(BesiegeError, ValueError):
    """The bytes are not a machine file of the game; the message gives the reason."""


class LogIncompleteError(BesiegeError, ValueError):
    """The log does not cover a whole trial; the message names the gap."""
