"""Spaces of text, the same for all tasks, so that vector environments can mix them."""

from __future__ import annotations

import string
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import read_from_shared_memory, write_to_shared_memory

from buildarena_benchmark.environment import LONGEST_CALL

MAX_OBSERVATION: Final = 32_768
"""Characters of an answer; a briefing has about 6,500."""
CUT: Final = " [cut]"
UNKNOWN: Final = "?"
_PRINTABLE: Final = string.digits + string.ascii_letters + string.punctuation + " "


class AnswerText(spaces.Text):
    """Text that an asynchronous vector environment updates.

    With Gymnasium's `Text`, such an environment with shared memory, the default, would return the
    texts at its creation.
    """


ACTION_SPACE: Final = spaces.Text(LONGEST_CALL, charset=frozenset(_PRINTABLE))
"""A tool call as JSON, which can escape any other character."""
OBSERVATION_SPACE: Final = AnswerText(
    MAX_OBSERVATION, min_length=0, charset=frozenset(_PRINTABLE + "\n°²·—…")
)
"""Text for a model."""


def observe(text: str) -> str:
    """Convert a text to an element of the observation space.

    Characters outside the space, which occur only in answers that quote a call, become question
    marks; long texts are cut.
    """
    if len(text) > MAX_OBSERVATION:
        text = text[: MAX_OBSERVATION - len(CUT)] + CUT
    charset = OBSERVATION_SPACE.character_set
    if charset.issuperset(text):
        return text
    return "".join(character if character in charset else UNKNOWN for character in text)


class _Current:
    """The current texts in a shared memory; a copy does not change."""

    def __init__(self, rows: np.ndarray[Any, np.dtype[np.int32]]) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: int) -> str:
        row = self._rows[index]
        ends = np.flatnonzero(row == 0)
        length = int(ends[0]) if len(ends) else len(row)
        text: bytes = row[:length].tobytes()
        return text.decode("utf-32-le")

    def __deepcopy__(self, memo: object) -> tuple[str, ...]:
        return tuple(self[index] for index in range(len(self)))


@read_from_shared_memory.register(AnswerText)
def _read_texts(space: AnswerText, shared_memory: Any, n: int = 1) -> _Current:
    numbers = np.frombuffer(shared_memory.get_obj(), dtype=np.int32)
    return _Current(numbers.reshape(n, space.max_length))


@write_to_shared_memory.register(AnswerText)
def _write(space: AnswerText, index: int, values: str, shared_memory: Any) -> None:
    numbers = np.frombuffer(shared_memory.get_obj(), dtype=np.int32)
    row = numbers.reshape(-1, space.max_length)[index]
    row[: len(values)] = np.frombuffer(values.encode("utf-32-le"), dtype=np.int32)
    row[len(values) :] = 0
