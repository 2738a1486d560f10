"""What a dataset holds, in numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class Counts:
    """What a dataset holds.

    Attributes:
        jobs: Its jobs.
        actions: Their actions.
        refused: Those of them that were refused.
        successes: Jobs with the outcome `success`.
        machines: Jobs with a machine.
        outcomes: Jobs by how they ended.
        cells: Jobs by task and model.
        licences: Licences of the rows.
    """

    jobs: int = 0
    actions: int = 0
    refused: int = 0
    successes: int = 0
    machines: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    cells: Counter[tuple[str, str]] = field(default_factory=Counter)
    licences: Counter[str] = field(default_factory=Counter)

    def add(self, job: Mapping[str, Any], actions: Sequence[Mapping[str, Any]]) -> None:
        """Counts a job."""
        self.jobs += 1
        self.actions += len(actions)
        self.refused += sum(not action["accepted"] for action in actions)
        self.successes += job["outcome"] == "success"
        self.machines += job["machine"] is not None
        self.outcomes[job["outcome"]] += 1
        self.cells[job["task"], job["model"]] += 1
        self.licences[job["license"]] += 1
