"""Figures that other benchmarks published, as reference rows: never ranked with ours.

They were measured in their own levels of the game, by their own scores, and name no trials: they
stand beside the task of ours that is most like theirs.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerRow:
    """One model in one workflow on a task of another benchmark, as that published it.

    Attributes:
        task: The built-in task that it stands beside.
        peer: The other benchmark.
        peer_task: What that calls its task.
        model: Its name of the model.
        workflow: Its name of the workflow.
        indicator_mean: Mean of its score.
        indicator_best: The best.
        indicator_std: Standard deviation.
    """

    task: str
    peer: str
    peer_task: str
    model: str
    workflow: str
    indicator_mean: float
    indicator_best: float
    indicator_std: float


@cache
def peer_rows() -> Mapping[str, Sequence[PeerRow]]:
    """The rows by built-in task, in the order of their publication.

    Source:
        Table of BesiegeField's paper: distances in blocks; workflows of a single agent, of
        iterative editing, and of hierarchical design.
    """
    text = resources.files("buildarena_benchmark.leaderboard").joinpath("peers.csv").read_text()
    rows: dict[str, list[PeerRow]] = {}
    for line in csv.DictReader(text.splitlines()):
        row = PeerRow(
            task=line["task"],
            peer=line["peer"],
            peer_task=line["peer_task"],
            model=line["model"],
            workflow=line["workflow"],
            indicator_mean=float(line["indicator_mean"]),
            indicator_best=float(line["indicator_best"]),
            indicator_std=float(line["indicator_std"]),
        )
        rows.setdefault(row.task, []).append(row)
    return MappingProxyType({task: tuple(task_rows) for task, task_rows in rows.items()})
