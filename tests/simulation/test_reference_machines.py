"""The reference machines keep their loads, distances and heights."""

import json
from typing import Any

import pytest
from support.machines.references import GOLDENS, REFERENCES, outcome

EXPECTED: dict[str, dict[str, dict[str, Any]]] = json.loads(GOLDENS.read_text(encoding="utf-8"))

# PyBullet takes several seconds a bridge; `make bench NAME=simulation` runs every machine on both.
QUICK_ON_PYBULLET = (
    "engine-flame-at-the-waist",
    "rocket-two",
    "assembly-braced",
    "beam",
    "car-without-keys",
)
TRIALS = [(name, "mujoco") for name in REFERENCES] + [(n, "pybullet") for n in QUICK_ON_PYBULLET]


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(("name", "engine"), TRIALS)
def test_a_reference_machine_gives_what_it_gave(name, engine) -> None:
    expected, found = EXPECTED[name][engine], outcome(name, engine)
    assert found["success"] == expected["success"]
    assert found["flags"] == expected["flags"]
    if expected["success"]:
        assert found["indicator"] == pytest.approx(expected["indicator"], rel=0.05)


def test_every_task_has_good_and_bad_machines() -> None:
    for task in {reference.task for reference in REFERENCES.values()}:
        kinds = {reference.quality for reference in REFERENCES.values() if reference.task == task}
        assert {"good", "bad"} <= kinds, task
    assert all(
        EXPECTED[name]["mujoco"]["success"] and EXPECTED[name]["pybullet"]["success"]
        for name, reference in REFERENCES.items()
        if reference.quality == "good"
    )
