"""Verdicts: honest and dishonest machines of each category, and what a trial must find of them.

Each category's `verdicts.json` has rows of a task, a machine (a builder's name with its parameters,
or tool calls), the trial's seed, its length where a part of it shows the verdict, and what of the
task's `scoring` and `scene` is otherwise. What is expected is the constraint that `refused` it, or
`success`, `flags` (null for any), the range of the indicator, and ranges of what else is `shown`:
metrics, `cargo_height`, `start_height`, how far `north` it came, and `floor_force`. Rows
with `nightly` take seconds.
"""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import pytest
from support.machines.piloted import FASTER_FIRST

from buildarena_benchmark import broken_constraint, builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_simulation import simulate

VERDICTS: Final[dict[str, dict[str, Any]]] = {
    f"{file.parent.name}: {name}": row
    for file in sorted(Path(__file__).parent.glob("*/verdicts.json"))
    for name, row in json.loads(file.read_text("utf-8")).items()
}


def built(row: dict[str, Any]) -> Machine:
    if "builder" in row:
        module, _, function = row["builder"].partition(":")
        return getattr(import_module(module), function)(**row.get("parameters", {}))
    machine = Machine(catalogue=builtin_tasks()[row["task"]].constraints.catalogue)
    for tool, arguments in row["calls"]:
        assert machine.act(tool, arguments).ok, (tool, arguments)
    return machine


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(
            name,
            engine,
            marks=pytest.mark.nightly
            if engine == "pybullet" or VERDICTS[name].get("nightly")
            else pytest.mark.ci,
        )
        for engine in FASTER_FIRST
        for name in VERDICTS
    ],
)
def test_a_machine_gets_its_verdict(name: str, engine: str) -> None:
    row = VERDICTS[name]
    task = builtin_tasks()[row["task"]]
    machine = built(row)
    if "refused" in row:
        assert (broken_constraint(task, machine) or (None,))[0] == row["refused"]
        return
    task = replace(task, scoring=task.scoring.model_copy(update=row.get("scoring", {})))
    duration = {"duration_s": row.get("seconds", task.scenario.duration_s)}
    written = task.scenario.model_dump() | duration | row.get("scene", {})
    scenario = type(task.scenario).model_validate(written)
    path = simulate(machine, scenario, engine, seed=row.get("seed"))
    result = score(task, machine, path)
    assert result.success == row["success"], result
    assert row["flags"] is None or list(result.flags) == row["flags"]
    low, high = row["indicator"]
    assert low <= result.indicator <= high
    seen: dict[str, Any] = {**result.metrics, "start_height": path.positions[:, 0, 2].max()}
    seen["north"] = (path.positions[:, 0, 1] - path.positions[0, 0, 1]).max()
    if path.cargo_position is not None:
        seen["cargo_height"] = path.cargo_position[:, 2].max()
    if path.bearing is not None:
        seen["floor_force"] = path.bearing.ground.max()
    for figure, (least, most) in row.get("shown", {}).items():
        assert least <= seen[figure] <= most, (figure, seen[figure])
