"""The built-in expert's designs as the calls of one who builds alone.

Run as a module in tests/, it writes them to a file for the tests of adapters, whose environments
have no worker; with `--references`, it writes the benchmark's references again.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from buildarena_benchmark import builtin_tasks, score
from buildarena_benchmark.categories import categories
from buildarena_benchmark.environment import Environment, references
from buildarena_benchmark.environment.expert_calls import Call, calls_with, control_of
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.design import Design, PastTrial
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import simulate
from buildarena_worker.builtin.reading import figures_of


def calls_of(task: str, seed: int = 0) -> list[Call]:
    """As the library's, with what a design that measures its world finds there."""
    design = expert_designs()[task](seed)
    answer = measured_for(design, task, seed) if design.steer else design.control or {}
    return calls_with(design, answer)


def measured_for(design: Design, task: str, seed: int, engine: str = "mujoco") -> Mapping[str, Any]:
    """What the controller says once it has measured the world of a seed by its test trials."""
    assert design.steer is not None
    drawn = builtin_tasks()[task].with_seed(seed)
    machine = Machine(catalogue=drawn.constraints.catalogue)
    actions = [action for part in design.parts.values() for action in part.actions]
    bound = [a for a in control_of(design.steer([])) if a[0].endswith("control_key")]
    for name, arguments in [*actions, *bound]:
        assert machine.act(name, dict(arguments)).ok
    seen: list[PastTrial] = []
    for _ in range(drawn.test_trials):
        program = design.steer(seen)
        presses = [
            KeyPress(time_s=press["time"], key=press["key"], hold_for_s=press["hold_for"])
            for press in program["control_sequence"]
        ]
        trajectory = simulate(machine, drawn.scenario, engine, controls=presses)
        told = score_text(drawn, score(drawn, machine, trajectory), trajectory)
        seen.append(PastTrial(program=program, measured=figures_of(told)))
    return design.steer(seen)


def built(design: Design, machine: Machine) -> Machine:
    """A machine after all that builds a design of one part, and binds and presses its keys.

    Raises:
        ValueError: Something of it is refused.
    """
    (part,) = design.parts.values()
    for tool, arguments in [*part.actions, *control_of(design.control or {})]:
        outcome = machine.act(tool, dict(arguments))
        if not outcome.ok:
            raise ValueError(outcome.text)
    return machine


def played(environment: Environment, calls: list[Call]) -> Environment:
    """The environment after these calls; every one must be accepted."""
    for made in calls:
        done = environment.step(made["tool"], made["arguments"], machine=made["machine"])
        assert done.ok, (made, done.feedback)
    return environment


class Experts(dict[str, dict[str, Any]]):
    """By task, the calls and the score that they earn: what the benchmark refers to."""

    def __missing__(self, task: str) -> dict[str, Any]:
        score = {"success": True, "indicator": references()[task], "flags": []}
        self[task] = {"calls": calls_of(task), "score": score}
        return self[task]


def scored(task: str) -> dict[str, Any]:
    """The score of the expert's machine on MuJoCo."""
    environment = Environment(task, simulator="mujoco")
    return played(environment, calls_of(task)).submit().trial.as_document()


if __name__ == "__main__":
    if "--references" in sys.argv:
        for category in categories():
            file = category.folder / "category.yaml"
            lines = [f"  {task}: {scored(task)['indicator']:.4f}" for task in category.references]
            kept = file.read_text("utf-8").partition("references:\n")
            file.write_text("".join(kept[:2]) + "\n".join(lines) + "\n", encoding="utf-8")
    else:
        experts = Experts()
        Path(sys.argv[1]).write_text(json.dumps({task: experts[task] for task in references()}))
