"""Errors of the benchmark room."""

from collections.abc import Sequence
from dataclasses import dataclass


class BenchmarkError(Exception):
    """Base of every error this room raises."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that is wrong with a file.

    Attributes:
        message: What is wrong.
        field: Where, such as "scenario.cargo.size[1]"; "" for the file as a whole.
        line: The line, from 1; None when it has none.
        choices: What would be valid, where that can be listed.
    """

    message: str
    field: str = ""
    line: int | None = None
    choices: tuple[str, ...] = ()

    def told(self, origin: str) -> str:
        """One line for people: ``origin:line: field: message; choose from …``."""
        place = origin if self.line is None else f"{origin}:{self.line}"
        field = f"{self.field}: " if self.field else ""
        choices = f"; choose from {', '.join(self.choices)}" if self.choices else ""
        return f"{place}: {field}{self.message}{choices}"


class SourceError(BenchmarkError, ValueError):
    """A file that somebody wrote is wrong; the message has a line for each fault.

    Attributes:
        faults: All that is wrong.
    """

    def __init__(self, faults: Sequence[Fault], *, origin: str) -> None:
        super().__init__("\n".join(fault.told(origin) for fault in faults))
        self.faults = tuple(faults)


class TaskError(SourceError):
    """A task file is wrong; the message names line, field and valid choices."""
