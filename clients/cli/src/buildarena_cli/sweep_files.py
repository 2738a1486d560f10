"""Sweep files, overridden by flags; every error has its line and field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_benchmark import SourceError, ValidationIssue
from buildarena_benchmark.tasks.sources import Source, parse_source, path_of
from buildarena_cli.errors import CommandError, refusal
from buildarena_client.errors import RefusedError

MAX_BYTES: Final = 2 * 1024 * 1024
"""Largest file: room for the 100,000 seeds that a sweep can name."""
FLAGS: Final[Mapping[str, str]] = {
    "tasks": "--task",
    "models": "--model",
    "samples": "--samples",
    "seeds": "--seed",
    "budget": "--max-cost-usd, --max-tokens, --max-requests",
}
"""Flags by the field that they take the place of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFile:
    """A sweep's file.

    Attributes:
        source: The file's content, with lines.
        content: The file's fields, some of them overridden.
        overridden: Fields set on the command line.
    """

    source: Source
    content: dict[str, Any]
    overridden: frozenset[str]

    def refusal(self, issues: Sequence[ValidationIssue]) -> CommandError:
        """Return the messages of the issues, each with its line of the file or its flag."""
        return CommandError("\n".join(map(self._line, issues)))

    def refused(self, error: RefusedError) -> Exception:
        """Return the messages of the service's field errors."""
        issues = [
            ValidationIssue.model_validate(
                {**entry, "line": self.source.line_of(path_of(entry["field"]))}
            )
            for entry in error.errors
        ]
        return self.refusal(issues) if issues else error

    def _line(self, issue: ValidationIssue) -> str:
        top = next(iter(path_of(issue.path)), "")
        if top not in self.overridden:
            return str(refusal([issue], self.source.origin))
        return str(refusal([issue.model_copy(update={"line": None})], FLAGS[str(top)]))


def read_sweep(file: Path, flags: Mapping[str, Any]) -> SweepFile:
    """Return a sweep file with the values of flags instead of its fields.

    Args:
        flags: Values by field; None for omitted flags.

    Raises:
        CommandError: The file can't be read, or it is not a valid sweep with the flags.
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
    values = {name: value for name, value in flags.items() if value is not None}
    content = {**source.content, **values}
    for given_field, replaced_field in (("samples", "seeds"), ("seeds", "samples")):
        if given_field in values:
            content.pop(replaced_field, None)
    sweep = SweepFile(source=source, content=content, overridden=frozenset(values))
    try:
        SweepSpec.model_validate(content)
    except ValidationError as error:
        raise sweep.refusal(source.issues(error, SweepSpec)) from error
    return sweep


def sweep_schema() -> dict[str, Any]:
    """Return the JSON schema of sweep files, for editors."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **SweepSpec.model_json_schema(),
        "title": "BuildArena sweep file",
    }
