"""The built-in expert's designs as the calls of one who builds alone.

tests/data/expert_calls.json keeps them for those who can't import the worker; `python -m
expert_calls` in this folder writes it, and the benchmark's references, again.
"""

import json
from pathlib import Path
from typing import Any

from buildarena_benchmark import builtin_tasks
from buildarena_environment import ASSEMBLY, MAIN, Environment
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.builtin.designs.design import Design

ROOT = Path(__file__).parents[3]
DATA = ROOT / "tests/data/expert_calls.json"
REFERENCES = ROOT / "libs/benchmark/src/buildarena_benchmark/tasks/references.json"

Call = dict[str, Any]


def calls_of(task: str, seed: int = 0) -> list[Call]:
    """What builds and drives the expert's machine, call by call."""
    design = DESIGNS[task](seed)
    calls = [
        call(name if design.assembly else MAIN, *action)
        for name, part in design.parts.items()
        for action in part.actions
    ]
    calls += [call(ASSEMBLY, *action) for action in design.assembly]
    whole = ASSEMBLY if design.assembly else MAIN
    return calls + [call(whole, *action) for action in _control(design)]


def call(machine: str, tool: str, arguments: Any) -> Call:
    return {"machine": machine, "tool": tool, "arguments": dict(arguments)}


def _control(design: Design) -> list[tuple[str, dict[str, Any]]]:
    actions: list[tuple[str, dict[str, Any]]] = []
    for bound in (design.control or {}).get("control_config", ()):
        for number, key in enumerate(bound["keys"]):
            tool = "add_control_key" if number else "change_control_key"
            told = {"block_id": bound["block"], "action": bound["action"], "new_key": key}
            actions.append((tool, told))
    pressed = (design.control or {}).get("control_sequence", ())
    return actions + [("add_control_sequence", dict(press)) for press in pressed]


def played(environment: Environment, calls: list[Call]) -> Environment:
    """The environment after these calls; every one must be accepted."""
    for made in calls:
        done = environment.step(made["tool"], made["arguments"], machine=made["machine"])
        assert done.ok, (made, done.feedback)
    return environment


def material() -> dict[str, Any]:
    """Calls and scores on MuJoCo, by task."""
    found = {}
    for task in builtin_tasks():
        environment = Environment(task, simulator="mujoco")
        calls = calls_of(task)
        trial = played(environment, calls).submit().trial
        told = trial.as_document()
        del told["wall_s"]
        found[task] = {"calls": calls, "score": told}
    return found


if __name__ == "__main__":
    made = material()
    lines = ",\n".join(f"{json.dumps(task)}: {json.dumps(told)}" for task, told in made.items())
    DATA.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
    references = {task: round(told["score"]["indicator"], 4) for task, told in made.items()}
    REFERENCES.write_text(json.dumps(references, indent=1) + "\n", encoding="utf-8")
