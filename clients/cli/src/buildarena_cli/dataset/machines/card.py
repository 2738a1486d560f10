"""The card of a dataset of machines, with its counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from buildarena_benchmark import CANARY
from buildarena_benchmark.scorers.registry import known_flags
from buildarena_cli.dataset.card import column_rows, rendered, size_category
from buildarena_cli.dataset.columns import MACHINES
from buildarena_cli.dataset.machines.drawing import MAKERS, TURNS
from buildarena_cli.dataset.rows import OURS

_ROWS: Final = "machines"


@dataclass(slots=True)
class Counts:
    """What a dataset of machines holds.

    Attributes:
        plan: What it follows from, see `Plan.as_document`.
        tasks: By split and task: machines, successes, disqualified ones and refused ones.
        makers: By maker: the same.
        retried: Machines that were simulated twice.
    """

    plan: Mapping[str, Any]
    tasks: dict[tuple[str, str], Counter[str]] = field(default_factory=dict)
    makers: dict[str, Counter[str]] = field(default_factory=dict)
    retried: int = 0

    def add(self, row: Mapping[str, Any]) -> None:
        """Counts a machine."""
        signs = {
            _ROWS: True,
            "successes": row["outcome"] == "success" and not row["disqualified"],
            "disqualified": row["disqualified"],
            "refused": row["reason"] is not None,
        }
        for counter in (
            self.tasks.setdefault((row["split"], row["task"]), Counter()),
            self.makers.setdefault(row["maker"], Counter()),
        ):
            counter.update({name: int(sign) for name, sign in signs.items()})
        self.retried += row["retried"]

    @property
    def total(self) -> Counter[str]:
        """All machines."""
        return sum(self.makers.values(), Counter())

    def of_split(self, split: str) -> Counter[str]:
        """The machines of a split."""
        return sum((c for (name, _), c in self.tasks.items() if name == split), Counter())


def card(counts: Counts, splits: Sequence[str]) -> str:
    """The card of a dataset with these counts; equal datasets have equal ones."""
    front = {
        "license": OURS,
        "language": ["en"],
        "pretty_name": "Machines tried in BuildArena",
        "size_categories": [size_category(counts.total[_ROWS])],
        "task_categories": ["tabular-regression", "text-generation"],
        "tags": ["buildarena", "engineering", "physics", "tool-use"],
        "configs": [
            {
                "config_name": "machines",
                "default": True,
                "data_files": [{"split": split, "path": f"{split}.parquet"} for split in splits],
            }
        ],
    }
    return rendered(
        "machines.md.j2",
        front,
        plan=counts.plan,
        total=counts.total,
        retried=counts.retried,
        splits=[(split, counts.of_split(split)) for split in splits],
        tasks=[(split, task, counts.tasks[split, task]) for split, task in sorted(counts.tasks)],
        makers=[
            (name, str(make.__doc__).strip(), counts.makers.get(name, Counter()))
            for name, (make, _) in MAKERS.items()
        ],
        turns=TURNS,
        columns=column_rows(MACHINES),
        flags=known_flags().values(),
        canary=CANARY,
    )
