"""A task as the rest of the service sees it."""

import hashlib
import json
import random
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, Self

from buildarena_benchmark.families.hidden_parameters import HiddenParameters, sample_scenario
from buildarena_benchmark.families.initial_machine import InitialMachine, make_initial_machine
from buildarena_benchmark.scoring.registry import known_scorers
from buildarena_benchmark.tasks.document import Constraints, Indicator, Scoring, TaskDocument
from buildarena_geometry import Catalogue, Machine
from buildarena_simulation import Scenario

SCORER_VERSION: Final = 8
"""Rises with every change of a scorer, or of a constraint's check, that can change a score; part
of every task's version."""

_ALWAYS: Final = (
    *("name", "title", "category", "level", "statement"),
    *("constraints", "scenario", "scoring", "indicator"),
)
_IF_ANY: Final = ("initial_machine", "hidden_parameters", "test_trials")
"""Fields of a task's document."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A task: its statement, constraints, trial and scoring.

    Attributes:
        name: Unique name, such as "support-1".
        version: Hash of everything that can change a score: statement, constraints, scenario,
            thresholds and the scorers' version. Which simulator ran is not part of it.
        title: Single line for people.
        category: Group the task belongs to, such as "support".
        level: Difficulty within the category, from 1.
        statement: Markdown with all information for a builder.
        scoring: The scorer's name and thresholds.
        indicator: The figure the task is ranked by.
        initial_machine: The initial machine; None where builders begin with nothing.
        hidden_parameters: Numbers of the scenario that are sampled and hidden; None without any.
        test_trials: Trials before the one that counts; 0 where every trial counts.
        seed: Seed of the random numbers; always 0 where there are none.
    """

    name: str
    version: str
    title: str
    category: str
    level: int
    statement: str
    constraints: Constraints
    scenario: Scenario
    scoring: Scoring
    indicator: Indicator
    initial_machine: InitialMachine | None = None
    hidden_parameters: HiddenParameters | None = None
    test_trials: int = 0
    seed: int = 0

    @property
    def scorer(self) -> str:
        """Name of the scorer."""
        return self.scoring.name

    @property
    def ceiling(self) -> float | None:
        """The greatest indicator that there is; None where only what can be built bounds it."""
        return known_scorers()[self.scorer].ceiling(self.scoring, self.scenario)

    @property
    def control(self) -> Literal["agent", "constant", "none"]:
        """Mode of control: the presser of the keys."""
        return self.scenario.control.mode

    @property
    def takes_programs(self) -> bool:
        """True if a controller may act in place of keys."""
        return self.scenario.senses is not None and self.control == "agent"

    def with_seed(self, seed: int) -> Self:
        """Return the task as a job of this seed has it, hidden parameters included."""
        if self.hidden_parameters is not None:
            scenario = sample_scenario(self.hidden_parameters, self.scenario, seed)
            return replace(self, seed=seed, scenario=scenario)
        return self if self.initial_machine is None else replace(self, seed=seed)

    def test_seed(self, number: int, seed: int) -> int | None:
        """Return the seed of a test trial's world.

        Args:
            number: Place of the test trial, from 1.

        Returns:
            The last one's own seed; None, the exact world, for the others, and for all trials of a
            task with hidden parameters.
        """
        if number != self.test_trials or self.hidden_parameters is not None:
            return None
        return random.Random(f"test trial {seed}").randrange(2**31)  # noqa: S311 - repeatable

    def new_machine(self, catalogue: Catalogue) -> Machine:
        """Return a builder's first machine: an empty one, or the initial machine."""
        if self.initial_machine is None:
            return Machine(catalogue=catalogue)
        return make_initial_machine(self.initial_machine, self.seed, catalogue)

    def as_document(self) -> Mapping[str, Any]:
        """Return all fields of a task file, defaults included, as JSON values."""
        fields = {name: getattr(self, name) for name in (*_ALWAYS, *_IF_ANY)}
        return {
            name: value.model_dump(mode="json") if hasattr(value, "model_dump") else value
            for name, value in fields.items()
            if value or name in _ALWAYS
        }


def task_of(document: TaskDocument) -> Task:
    """Return the task a validated document describes."""
    fields = {name: getattr(document, name) for name in TaskDocument.model_fields}
    fields["statement"] = document.statement.strip() + "\n"
    return Task(version=_version_of(document), **fields)


def _version_of(document: TaskDocument) -> str:
    content = document.model_dump(
        mode="json",
        include={
            *("statement", "constraints", "initial_machine"),
            *("hidden_parameters", "test_trials", "scenario", "scoring"),
        },
    )
    del content["constraints"]["module_list"]
    if document.constraints.on_demand:
        # Versions hash the mode's former name, and nothing for the default.
        content["constraints"]["module_list"] = "looked_up"
    content["scorer_version"] = SCORER_VERSION
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:12]
