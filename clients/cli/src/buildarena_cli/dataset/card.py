"""The card of a dataset: its content, for people and for the `datasets` library."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from buildarena_benchmark import CANARY
from buildarena_benchmark.scoring.registry import known_flags
from buildarena_cli.dataset.columns import JOBS, Column

CARD: Final = "README.md"
FILE: Final = "jobs.parquet"
SIZES: Final = (1_000, 10_000, 100_000, 1_000_000)
SIZE_NAMES: Final = ("n<1K", "1K<n<10K", "10K<n<100K", "100K<n<1M", "1M<n<10M")
"""What the hub calls these sizes."""
MARKDOWN: Final = re.compile(
    r"[\\`*\[\]<>|&~$#]"  # code, emphasis, links, tags, columns, entities, formulas, headings
    r"|(?<![^\W_])_|_(?![^\W_])"  # between two letters it is only itself
    r"|(?<=:)/(?=/)|(?<=www)\.|@"  # addresses, which would become links
)


@dataclass(slots=True)
class Counts:
    """Counts of a dataset's content.

    Attributes:
        jobs: Its jobs.
        successes: Jobs with the outcome `success`.
        machines: Jobs with a machine.
        outcomes: Jobs by how they ended.
        cells: Jobs by task and model.
        licences: Licences of the rows.
    """

    jobs: int = 0
    successes: int = 0
    machines: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    cells: Counter[tuple[str, str]] = field(default_factory=Counter)
    licences: Counter[str] = field(default_factory=Counter)

    def add(self, job: Mapping[str, Any]) -> None:
        """Count a job."""
        self.jobs += 1
        self.successes += job["outcome"] == "success"
        self.machines += job["machine"] is not None
        self.outcomes[job["outcome"]] += 1
        self.cells[job["task"], job["model"]] += 1
        self.licences[job["license"]] += 1


def card(counts: Counts) -> str:
    """Return the card of a dataset with these counts; equal datasets have equal ones."""
    return rendered(
        "card.md.j2",
        _front_matter(counts),
        counts=counts,
        canary=CANARY,
        outcomes=sorted(counts.outcomes.items()),
        cells=sorted(counts.cells.items()),
        licences=sorted(counts.licences.items()),
        jobs=column_rows(JOBS),
        flags=known_flags().values(),
    )


def rendered(template: str, front: Mapping[str, Any], **values: Any) -> str:
    """Return a card: metadata for the `datasets` library, and a template's text."""
    environment = Environment(
        loader=PackageLoader("buildarena_cli.dataset"),
        autoescape=False,  # noqa: S701 - Markdown, whose values go through `escape`
        finalize=_escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    text = environment.get_template(template).render(code=Markup, **values)
    return f"---\n{yaml.safe_dump(dict(front), sort_keys=False, allow_unicode=True)}---\n\n{text}"


def size_category(rows: int) -> str:
    """Return the hub's category for a dataset with a number of rows."""
    return SIZE_NAMES[sum(rows >= bound for bound in SIZES)]


def _front_matter(counts: Counts) -> dict[str, Any]:
    licences = sorted(counts.licences)
    return {
        "license": licences[0] if len(licences) == 1 else licences,
        "language": ["en"],
        "pretty_name": "Machines built by models in BuildArena",
        "size_categories": [size_category(counts.jobs)],
        "task_categories": ["text-generation"],
        "tags": ["buildarena", "tool-use", "agents", "engineering", "physics"],
        "configs": [
            {"config_name": "jobs", "data_files": [{"split": "train", "path": FILE}]},
        ],
    }


def _escaped(value: Any) -> Any:
    """Return a value as text without markup, unless it is `Markup`."""
    return _one_line(value) if type(value) is str else value


def _one_line(text: str) -> str:
    """Return an untrusted text for a line of Markdown, with its markup escaped."""
    line = "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text)
    return MARKDOWN.sub(lambda match: f"\\{match[0]}", line)


def column_rows(columns: Sequence[Column]) -> list[tuple[str, str, str]]:
    """Return name, type and meaning of each column."""
    return [(column.name, _type(column.type), column.meaning) for column in columns]


def _type(kind: Any) -> str:
    text = str(kind)
    return "list of messages" if "tool_calls" in text else text.replace("item: ", "")
