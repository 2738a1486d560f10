"""Errors of the benchmark, and the common form of reports on invalid input."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class BenchmarkError(Exception):
    """Base of every error that this package raises."""


class ValidationIssue(BaseModel):
    """An error in a file or a request.

    Attributes:
        path: Place, such as "scenario.cargo.size[1]"; "" for the whole. The API calls it `field`.
        line: Line of the text, from 1; None if there is none.
        choices: Valid values, where they can be listed.
    """

    model_config = ConfigDict(
        frozen=True,
        validate_by_name=True,
        validate_by_alias=True,
        json_schema_extra={"description": "One thing that is wrong with a file or a request."},
    )

    path: Annotated[
        str,
        Field(alias="field", description="Where, for example tasks[1]", examples=["tasks[0]"]),
    ] = ""
    message: Annotated[str, Field(examples=["unknown task 'support-9'"])]
    line: Annotated[int | None, Field(description="Line of an uploaded text, from 1")] = None
    choices: Annotated[tuple[str, ...], Field(description="What would be valid, where known")] = ()

    def describe(self, origin: str) -> str:
        """Return one line for people: ``origin:line: path: message; choose from …``."""
        place = origin if self.line is None else f"{origin}:{self.line}"
        path = f"{self.path}: " if self.path else ""
        choices = f"; choose from {', '.join(self.choices)}" if self.choices else ""
        return f"{place}: {path}{self.message}{choices}"


class SourceError(BenchmarkError, ValueError):
    """An invalid file of a user; the message has a line for each issue."""

    def __init__(self, issues: Sequence[ValidationIssue], *, origin: str) -> None:
        super().__init__("\n".join(issue.describe(origin) for issue in issues))
        self.issues = tuple(issues)


class TaskError(SourceError):
    """A task file is wrong; the message names line, field and valid choices."""
