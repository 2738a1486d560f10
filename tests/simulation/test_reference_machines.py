"""The reference machines keep their loads, distances and heights."""

import json
from typing import Any

import pytest
from tests.simulation.references import GOLDENS, REFERENCES, load_machine, outcome

EXPECTED: dict[str, dict[str, dict[str, Any]]] = json.loads(GOLDENS.read_text(encoding="utf-8"))

# PyBullet takes several seconds a bridge; `make bench-simulation` runs every machine on both.
QUICK_ON_PYBULLET = (
    "engine-flame-at-the-waist",
    "rocket-two",
    "assembly-braced",
    "beam",
    "car-without-keys",
)
TRIALS = [(name, "mujoco") for name in REFERENCES] + [(n, "pybullet") for n in QUICK_ON_PYBULLET]


@pytest.mark.parametrize(("name", "engine"), TRIALS)
def test_a_reference_machine_gives_what_it_gave(name: str, engine: str) -> None:
    expected, found = EXPECTED[name][engine], outcome(name, engine)
    assert found["success"] == expected["success"]
    assert found["flags"] == expected["flags"]
    if expected["success"]:
        assert found["indicator"] == pytest.approx(expected["indicator"], rel=0.05)


@pytest.mark.parametrize("name", REFERENCES)
def test_a_design_gives_the_log_in_its_file(name: str) -> None:
    parts, actions = REFERENCES[name].logs()
    machine = load_machine(name)
    assert [(record.name, record.arguments) for record in machine.log] == [
        (action["op"], json.loads(json.dumps(action["params"]))) for action in actions
    ]
    assert set(machine.available) == set(parts)


def test_every_task_has_good_and_bad_machines() -> None:
    for task in {reference.task for reference in REFERENCES.values()}:
        kinds = {reference.quality for reference in REFERENCES.values() if reference.task == task}
        assert {"good", "bad"} <= kinds, task
    assert all(
        EXPECTED[name]["mujoco"]["success"] and EXPECTED[name]["pybullet"]["success"]
        for name, reference in REFERENCES.items()
        if reference.quality == "good"
    )
