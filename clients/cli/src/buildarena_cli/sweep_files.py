"""Sweep files, overridden by flags; every error has its line and field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_benchmark import SourceError, ValidationIssue
from buildarena_benchmark.tasks.sources import Source, parse_source, path_of
from buildarena_cli.client import RefusedError
from buildarena_cli.errors import CommandError, suggest_field

MAX_BYTES: Final = 2 * 1024 * 1024
"""Largest file: room for the 100,000 seeds that a sweep can name."""
FLAGS: Final[Mapping[str, str]] = {
    "tasks": "--task",
    "models": "--model",
    "samples": "--samples",
    "seeds": "--seed",
    "budget": "--max-cost-usd, --max-tokens, --max-requests",
    "task": "TASK",
    "model": "MODEL",
    "seed": "--seed",
}
"""Words of the command line by the field that they take the place of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecFile:
    """A file of fields for a request to the API.

    Attributes:
        source: The file's content, with lines.
        content: The file's fields, some of them overridden.
        overridden: Fields set on the command line.
    """

    source: Source
    content: dict[str, Any]
    overridden: frozenset[str] = field(default_factory=frozenset)

    def with_words(self, values: Mapping[str, Any]) -> SpecFile:
        """Return the file with values from the command line instead of its fields."""
        return replace(self, content={**self.content, **values}, overridden=frozenset(values))

    def refusal(self, issues: Sequence[ValidationIssue]) -> CommandError:
        """Return the messages of the issues, each with its line of the file or its flag."""
        return CommandError("\n".join(self._line(issue) for issue in issues))

    def refused(self, error: RefusedError) -> CommandError:
        """Return the messages of the service's field errors."""
        if not error.errors:
            return error
        return self.refusal(
            [
                ValidationIssue(
                    path=entry["field"],
                    message=entry["message"],
                    line=self.source.line_of(path_of(entry["field"])),
                    choices=tuple(entry["choices"]),
                )
                for entry in error.errors
            ]
        )

    def _line(self, issue: ValidationIssue) -> str:
        top = next(iter(path_of(issue.path)), "")
        hint = suggest_field(issue.path, issue.message, issue.choices)
        if top not in self.overridden:
            return issue.describe(self.source.origin) + hint
        without_line = ValidationIssue(
            path=issue.path, message=issue.message, choices=issue.choices
        )
        return without_line.describe(FLAGS[str(top)]) + hint


def read_fields(file: Path) -> SpecFile:
    """Return the fields in a YAML file.

    Raises:
        CommandError: The file can't be read, or is not a mapping.
    """
    try:
        text = file.read_text(encoding="utf-8")
        source = parse_source(text, origin=str(file), max_bytes=MAX_BYTES)
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CommandError(f"{file}: not UTF-8: {error.reason}") from error
    except SourceError as error:
        raise CommandError(str(error)) from error
    if not isinstance(source.content, dict):
        raise CommandError(f"{file}:1: must be a mapping of fields, such as tasks: [support-1]")
    return SpecFile(source=source, content=dict(source.content))


def read_sweep(file: Path, flags: Mapping[str, Any]) -> SpecFile:
    """Return a sweep file with the values of flags instead of its fields.

    Args:
        flags: Values by field; None for omitted flags.

    Raises:
        CommandError: The file, or its combination with the flags, is not a valid sweep.
    """
    values = {name: value for name, value in flags.items() if value is not None}
    sweep = read_fields(file).with_words(values)
    for given_field, replaced_field in (("samples", "seeds"), ("seeds", "samples")):
        if given_field in values:
            sweep.content.pop(replaced_field, None)
    try:
        SweepSpec.model_validate(sweep.content)
    except ValidationError as error:
        raise sweep.refusal(sweep.source.issues(error, SweepSpec)) from error
    return sweep


def sweep_schema() -> dict[str, Any]:
    """Return the JSON schema of sweep files, for editors."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **SweepSpec.model_json_schema(),
        "title": "BuildArena sweep file",
    }
