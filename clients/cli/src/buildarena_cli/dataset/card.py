"""The card of a dataset: its content, for people and for the `datasets` library."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from buildarena_benchmark import CANARY
from buildarena_benchmark.scoring.registry import known_flags
from buildarena_cli.dataset.columns import JOBS

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
    environment = Environment(
        loader=PackageLoader("buildarena_cli.dataset"),
        autoescape=False,  # noqa: S701 - Markdown, whose values go through `finalize`
        finalize=_escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    text = environment.get_template("card.md.j2").render(
        code=Markup,
        counts=counts,
        canary=CANARY,
        outcomes=sorted(counts.outcomes.items()),
        cells=sorted(counts.cells.items()),
        licences=sorted(counts.licences.items()),
        jobs=[(column.name, _type(column.type), column.meaning) for column in JOBS],
        flags=known_flags().values(),
    )
    licences = sorted(counts.licences)
    front = {
        "license": licences[0] if len(licences) == 1 else licences,
        "language": ["en"],
        "pretty_name": "Machines built by models in BuildArena",
        "size_categories": [SIZE_NAMES[sum(counts.jobs >= bound for bound in SIZES)]],
        "task_categories": ["text-generation"],
        "tags": ["buildarena", "tool-use", "agents", "engineering", "physics"],
        "configs": [
            {"config_name": "jobs", "data_files": [{"split": "train", "path": FILE}]},
        ],
    }
    return f"---\n{yaml.safe_dump(front, sort_keys=False, allow_unicode=True)}---\n\n{text}"


def _escaped(value: Any) -> Any:
    """Return a text as one line of Markdown with its markup escaped, unless it is `Markup`."""
    if type(value) is not str:
        return value
    line = "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in value)
    return MARKDOWN.sub(lambda match: f"\\{match[0]}", line)


def _type(kind: Any) -> str:
    text = str(kind)
    return "list of messages" if "tool_calls" in text else text.replace("item: ", "")
