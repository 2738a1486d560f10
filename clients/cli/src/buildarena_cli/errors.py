"""Errors of the command line, and its exit codes."""

from __future__ import annotations

DONE, FAILED, PARTIAL = 0, 1, 3
"""Exit codes: all done; an error; done, but some jobs errored or were cancelled. Wrong words: 2."""


class CommandError(Exception):
    """A command can't be carried out.

    Attributes:
        code: The exit code.
    """

    def __init__(self, message: str, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code
