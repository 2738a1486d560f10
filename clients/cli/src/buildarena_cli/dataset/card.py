"""The card of a dataset: what it holds, for people and for the `datasets` library."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from buildarena_benchmark import CANARY
from buildarena_benchmark.scorers.registry import known_flags
from buildarena_cli.dataset.columns import ACTIONS, JOBS, Column
from buildarena_cli.dataset.counts import Counts
from buildarena_cli.dataset.escaping import markdown_cell

CARD: Final = "README.md"
FILES: Final = {"jobs": "jobs.parquet", "actions": "actions.parquet"}
SIZES: Final = (1_000, 10_000, 100_000, 1_000_000)
SIZE_NAMES: Final = ("n<1K", "1K<n<10K", "10K<n<100K", "100K<n<1M", "1M<n<10M")
"""What the hub calls these sizes."""


def card(counts: Counts) -> str:
    """The card of a dataset with these counts; equal datasets have equal ones."""
    return rendered(
        "card.md.j2",
        _front_matter(counts),
        counts=counts,
        canary=CANARY,
        outcomes=sorted(counts.outcomes.items()),
        cells=sorted(counts.cells.items()),
        licences=sorted(counts.licences.items()),
        jobs=column_rows(JOBS),
        actions=column_rows(ACTIONS),
        flags=known_flags().values(),
    )


def rendered(template: str, front: Mapping[str, Any], **values: Any) -> str:
    """A card: what the `datasets` library reads first, and a template's text."""
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
    """What the hub calls a dataset of so many rows."""
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
            {
                "config_name": name,
                **({"default": True} if name == "jobs" else {}),
                "data_files": [{"split": "train", "path": file}],
            }
            for name, file in FILES.items()
        ],
    }


def _escaped(value: Any) -> Any:
    """A value as text that is no markup; what is our own is given as `Markup`."""
    return markdown_cell(value) if type(value) is str else value


def column_rows(columns: Sequence[Column]) -> list[tuple[str, str, str]]:
    """Name, type and meaning of each column, for a card."""
    return [(column.name, _type(column.type), column.meaning) for column in columns]


def _type(kind: Any) -> str:
    text = str(kind)
    return "list of messages" if "tool_calls" in text else text.replace("item: ", "")
