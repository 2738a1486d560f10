"""The trials of a first evening: machines that are packaged as data, and what they go through."""

from __future__ import annotations

import gzip
import json
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final

from buildarena_benchmark import Task, builtin_tasks, paper_tasks
from buildarena_geometry import Machine
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement

DROP_CENTER: Final = 10.0
"""Height from which the cross falls: of its blocks' centres, units."""
BEAM: Final = "Small Wooden Block"
FRAME: Final = {"sampler": (BEAM,), "scales": (BEAM, "Swivel")}
"""What the sampler's beam and the posts of the scales consist of."""
OWN: Final[dict[str, dict[str, Any]]] = {
    "sampler": {"duration_s": 2.0, "control": {"mode": "agent"}},
    "probe": {"duration_s": 20.0},
    "drop": {
        "duration_s": 4.0,
        "placement": {"kind": "span", "gap": 5.0, "lowest_center": DROP_CENTER},
        "tracked_blocks": ("1", "2", "3", "4", "5"),
    },
    "scales": {"duration_s": 2.0, "control": {"mode": "agent"}},
    "wheels": {"duration_s": 8.0, "control": {"mode": "agent"}},
    "program": {
        "duration_s": 4.0,
        "control": {"mode": "agent"},
        "senses": {"offers": ("pose", "wheels")},
        "tracked_blocks": ("1",),
    },
}
"""Scenarios that are no task's, all of them in the flat sandbox."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A machine and what it is put through.

    Attributes:
        name: A task's name, or one of the steps' own.
        machine: The machine.
        scenario: What it is put through.
        task: The task whose verdict counts; None where there is none.
    """

    name: str
    machine: Machine
    scenario: Scenario
    task: Task | None = None


@cache
def trial_named(name: str) -> Trial:
    """A trial by its name.

    Raises:
        KeyError: There is none of this name.
    """
    machine = Machine.from_document(_documents()[name])
    if name in paper_tasks():
        task = builtin_tasks()[name]
        return Trial(name=name, machine=machine, scenario=task.scenario, task=task)
    scenario = {**OWN[name]}
    if name in FRAME:
        # What they are built of is left out: the log's window keeps up with a hundred blocks.
        blocks = machine.blocks.values()
        frame = FRAME[name]
        scenario["tracked_blocks"] = tuple(b.id for b in blocks if b.module.name not in frame)
    return Trial(name=name, machine=machine, scenario=Scenario.model_validate(scenario))


def is_released(scenario: Scenario) -> bool:
    """Whether a machine starts in the air."""
    return isinstance(scenario.placement, SpanPlacement)


@cache
def _documents() -> dict[str, Any]:
    packed = resources.files(__package__).joinpath("machines.json.gz").read_bytes()
    documents: dict[str, Any] = json.loads(gzip.decompress(packed))
    return documents
