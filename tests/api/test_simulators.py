"""What jobs can name as their simulator, as the API lists it."""

import pytest
from support.jobs import report_worker

from buildarena_simulation import SIMULATION_VERSION
from buildarena_store.states import simulate_queue


@pytest.fixture
def listed(api):
    def simulators() -> dict[str, dict[str, object]]:
        found = api.get("/v1/simulators").raise_for_status().json()
        return {view["name"]: view for view in found}

    return simulators


def test_the_engines_are_listed_whether_or_not_a_worker_is_there(listed) -> None:
    assert listed() == {
        name: {
            "name": name,
            "version": SIMULATION_VERSION,
            "kind": "engine",
            "repeatable": True,
            "default": name == "pybullet",
            "workers": 0,
            "served": False,
        }
        for name in ("pybullet", "mujoco")
    }


def test_what_a_worker_announces_is_listed_and_can_be_asked_for(context, api, listed) -> None:
    spec = {"task": "support-1", "model": "builtin/idle", "simulator": "unity"}
    refused = api.post("/v1/jobs", json=spec)
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert error["choices"] == ["pybullet", "mujoco"]
    for number, name in enumerate(("unity", "unity", "mujoco")):
        versions = {"simulation": "7.1", "kind": "game", "repeatable": False}
        report_worker(context, f"worker-{number}", simulate_queue(name), versions=versions)
    unity = listed()["unity"]
    assert (unity["version"], unity["kind"], unity["default"]) == ("7.1", "game", False)
    assert (unity["workers"], unity["served"]) == (2, True)
    assert (listed()["mujoco"]["version"], listed()["mujoco"]["served"]) == (
        SIMULATION_VERSION,
        True,
    )
    assert api.post("/v1/jobs", json=spec).status_code == 202
