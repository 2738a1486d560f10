"""Near words: what somebody may have meant who typed something else."""

from __future__ import annotations

import re
from collections.abc import Iterable

QUOTED = re.compile(r"'([^']*)'")
MAX_WORDS = 3
LIKENESS = 0.55
"""Least similarity of difflib (0 to 1): finds "seeds" for "seed" and nothing for "xyz"."""


def near_words(word: str, choices: Iterable[str]) -> list[str]:
    """The choices that are spelled most like a word, the nearest first; none when all are far."""
    from difflib import get_close_matches

    by_spelling: dict[str, str] = {}
    for choice in choices:
        by_spelling.setdefault(choice.lower(), choice)
    spelled = word.lower()
    found = get_close_matches(spelled, by_spelling, n=MAX_WORDS, cutoff=LIKENESS)
    if len(spelled) > 1:
        # "expert" is far from "builtin/expert" by its letters, and near all the same.
        parts = [known for known in by_spelling if spelled in re.split(r"[/:. _-]", known)]
        found += [known for known in parts if known not in found]
    return [by_spelling[known] for known in found[:MAX_WORDS] if by_spelling[known] != word]


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` with the near words, or nothing."""
    found = near_words(word, choices)
    return f"; did you mean {' or '.join(found)}?" if found else ""


def near_field(field: str, message: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` for a validation message.

    Args:
        field: The field it is about, such as ``decoding.heat``.
        message: What is wrong; a word that it quotes is the wrong one, else the field's name is.
        choices: What would be valid.
    """
    quoted = QUOTED.findall(message)
    return did_you_mean(quoted[-1] if quoted else field.rpartition(".")[2], choices)
