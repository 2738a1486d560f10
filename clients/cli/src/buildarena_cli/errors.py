"""Errors of the command line, its exit codes, and suggestions for wrong words."""

from __future__ import annotations

import re
from collections.abc import Iterable

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
