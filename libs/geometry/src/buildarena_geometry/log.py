"""What was done to a machine, action by action."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, overload

from .outcomes import RefusalClass

if TYPE_CHECKING:
    from .machine import Machine
    from .modules import Catalogue

_LONGEST_TEXT = 2_000  # characters a text in the log may have; a note may have far fewer
_DEEPEST = 8  # levels of lists and objects inside one another
_WIDEST = 200  # entries of a list or object


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionRecord:
    """One action as it arrived.

    Attributes:
        name: the action's name.
        arguments: JSON values. What could not be written down as JSON stands there as an object
            {"unreadable": what it was}, which every action refuses just as it refused the original.
        reason: why it was refused; None if it was accepted.
    """

    name: str
    arguments: object
    reason: RefusalClass | None = None

    @property
    def ok(self) -> bool:
        """Whether it was accepted."""
        return self.reason is None


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionLog(Sequence[ActionRecord]):
    """The actions of one machine in order, with all it takes to do them again.

    Attributes:
        records: accepted and refused actions.
        catalogue: the modules the machine was made of.
        available: the machines an assembly was made of.
    """

    records: tuple[ActionRecord, ...]
    catalogue: Catalogue = field(repr=False)
    available: Mapping[str, Machine] = field(repr=False, default_factory=dict)

    @overload
    def __getitem__(self, index: int) -> ActionRecord: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[ActionRecord, ...]: ...
    def __getitem__(self, index: int | slice) -> ActionRecord | tuple[ActionRecord, ...]:
        return self.records[index]

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[ActionRecord]:
        return iter(self.records)


def json_value(value: object, depth: int = 0) -> object:
    """A copy of the value that can be written as JSON anywhere, databases included.

    Args:
        value: anything at all.
        depth: how many lists and objects it lies inside.
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        # Beyond 64 bits, databases and other languages no longer read what was written.
        return int(value) if abs(value) < 2**63 else {"unreadable": "huge number"}
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {"unreadable": str(float(value))}
    if isinstance(value, str):
        return json_text(value)
    if depth == _DEEPEST:
        return {"unreadable": "nested too deep"}
    if isinstance(value, Mapping) and len(value) <= _WIDEST:
        entries = [
            (json_text(key) if isinstance(key, str) else {"unreadable": "key"}, entry)
            for key, entry in value.items()
        ]
        if all(isinstance(key, str) for key, _ in entries):
            return {str(key): json_value(entry, depth + 1) for key, entry in entries}
    if isinstance(value, list | tuple) and len(value) <= _WIDEST:
        return [json_value(entry, depth + 1) for entry in value]
    return {"unreadable": type(value).__name__}


def json_text(text: str) -> str | dict[str, str]:
    """The text itself, or what is wrong with it."""
    if len(text) > _LONGEST_TEXT:
        return {"unreadable": f"text of {len(text)} characters"}
    if "\x00" in text or any("\ud800" <= char <= "\udfff" for char in text):
        return {"unreadable": "text with NUL characters or lone surrogates"}
    return str(text)
