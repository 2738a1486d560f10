"""Errors of the command line, its exit codes, and what a wrong word may have meant."""

from __future__ import annotations

import re
from collections.abc import Iterable

DONE, FAILED, USAGE, PARTIAL = 0, 1, 2, 3
"""Exit codes: all done; an error; a usage error; done, but some jobs errored or were cancelled."""


class CommandError(Exception):
    """A command can't be carried out."""

    def __init__(self, message: str, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code


QUOTED = re.compile(r"'([^']*)'")
LIKENESS = 0.55
"""Least similarity of difflib (0 to 1): finds "seeds" for "seed" and nothing for "xyz"."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` with the nearest word, or nothing where all are far."""
    from difflib import get_close_matches

    near = get_close_matches(word, [choice for choice in choices if choice != word], 1, LIKENESS)
    return f"; did you mean {near[0]}?" if near else ""


def suggested_field(field: str, message: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` for a validation message.

    Args:
        field: The field it is about, such as ``decoding.heat``.
        message: What is wrong; a word that it quotes is the wrong one, else the field's name is.
        choices: What would be valid.
    """
    quoted = QUOTED.findall(message)
    return did_you_mean(quoted[-1] if quoted else field.rpartition(".")[2], choices)
