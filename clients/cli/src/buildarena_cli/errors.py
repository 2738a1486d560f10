"""Errors of the command line, its exit codes, and suggestions for wrong words."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from buildarena_client.config import KEY_VARIABLE
from buildarena_client.errors import (
    ClientError,
    KeyRefusedError,
    RefusedError,
    UnavailableError,
    UnreachableError,
    described,
)

if TYPE_CHECKING:
    from buildarena_benchmark import ValidationIssue

DONE, FAILED, USAGE, PARTIAL = 0, 1, 2, 3
"""Exit codes: all done; an error; a usage error; done, but some jobs errored or were cancelled."""


class CommandError(Exception):
    """A command that can't be carried out."""

    def __init__(self, message: str, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code


QUOTED = re.compile(r"'([^']*)'")
LIKENESS = 0.55
"""Least similarity of difflib (0 to 1): finds "seeds" for "seed" and nothing for "xyz"."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return `; did you mean …?` with the most similar word, or nothing if none is similar."""
    from difflib import get_close_matches

    matches = get_close_matches(word, [choice for choice in choices if choice != word], 1, LIKENESS)
    return f"; did you mean {matches[0]}?" if matches else ""


def suggest_field(field: str, message: str, choices: Iterable[str]) -> str:
    """Return `; did you mean …?` for a validation message.

    Args:
        field: Path of the field, such as ``decoding.heat``.
        message: Text of the error; the word that it quotes, or else the field's name, is wrong.
        choices: Valid words.
    """
    quoted = QUOTED.findall(message)
    return did_you_mean(quoted[-1] if quoted else field.rpartition(".")[2], choices)


def refusal(issues: Iterable[ValidationIssue], origin: str) -> CommandError:
    """Return the messages of a file's issues, with suggestions."""
    return CommandError(
        "\n".join(
            issue.describe(origin) + suggest_field(issue.path, issue.message, issue.choices)
            for issue in issues
        )
    )


def explain(error: ClientError) -> str:
    """Return what a user reads of an error of the client."""
    if isinstance(error, KeyRefusedError):
        return f"{error}: set {KEY_VARIABLE} or {KEY_VARIABLE}_FILE to a valid key"
    if isinstance(error, RefusedError):
        return "\n".join(map(_line, error.errors)) or error.detail
    if isinstance(error, UnreachableError) and not isinstance(error, UnavailableError):
        hint = "start it with `buildarena up`, or name another with --url or BUILDARENA_URL"
        return f"{error}: {hint}"
    return str(error)


def _line(error: dict[str, Any]) -> str:
    hint = suggest_field(error["field"], error["message"], error["choices"])
    return described(error) + (hint if error["choices"] else "")
