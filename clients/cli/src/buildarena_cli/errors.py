"""Errors of the command line, and its exit codes."""

from __future__ import annotations

DONE, FAILED, USAGE, PARTIAL = 0, 1, 2, 3
"""Exit codes: all done; an error; a usage error; done, but some jobs errored or were cancelled."""


class CommandError(Exception):
    """A command can't be carried out.

    Attributes:
        code: The exit code.
    """

    def __init__(self, message: str, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code
