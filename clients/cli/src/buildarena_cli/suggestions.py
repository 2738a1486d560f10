"""Near words: what a misspelled word may have meant."""

from __future__ import annotations

import re
from collections.abc import Iterable

QUOTED = re.compile(r"'([^']*)'")
MAX_WORDS = 3
LIKENESS = 0.55
"""Least similarity of difflib (0 to 1): finds "seeds" for "seed" and nothing for "xyz"."""
SPREAD = 0.1
"""How much less like the word than the nearest one the others may be."""


def suggested_words(word: str, choices: Iterable[str]) -> list[str]:
    """The choices that are spelled most like a word, the nearest first; none when all are far."""
    from difflib import SequenceMatcher

    matcher = SequenceMatcher(b=word.lower())
    likeness = {}
    for choice in choices:
        matcher.set_seq1(choice.lower())
        # "expert" is far from "builtin/expert" by its letters, and near all the same.
        part = len(word) > 1 and word.lower() in re.split(r"[/:. _-]", choice.lower())
        likeness[choice] = 1.0 if part else matcher.ratio()
    least = max(LIKENESS, max(likeness.values(), default=0.0) - SPREAD)
    closest = sorted(likeness, key=lambda choice: -likeness[choice])
    return [choice for choice in closest if choice != word and likeness[choice] >= least][
        :MAX_WORDS
    ]


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` with the near words, or nothing."""
    near = suggested_words(word, choices)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def suggested_field(field: str, message: str, choices: Iterable[str]) -> str:
    """`; did you mean …?` for a validation message.

    Args:
        field: The field it is about, such as ``decoding.heat``.
        message: What is wrong; a word that it quotes is the wrong one, else the field's name is.
        choices: What would be valid.
    """
    quoted = QUOTED.findall(message)
    return did_you_mean(quoted[-1] if quoted else field.rpartition(".")[2], choices)
