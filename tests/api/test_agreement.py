from datetime import UTC, datetime

import pytest
from sqlalchemy import insert, update
from support.jobs import execute

from buildarena_api.leaderboard.agreement import agreement_rows
from buildarena_store.boards import Annotated
from buildarena_store.tables import jobs, rollouts

TRACK = "five-role/besiege-1.75-1.4/default-0-2"

ENDED = {
    "state": "done",
    "outcome": "unsuccessful",
    "success": False,
    "indicator": 0.0,
    "metrics": {},
    "flags": [],
    "finished_at": datetime.now(UTC),
}


def said(success: bool, indicator: float, version: str = "2") -> dict[str, object]:
    return {"success": success, "indicator": indicator, "flags": [], "simulation": version}


def change(context, job: str, **values: object) -> None:
    execute(context, update(jobs).where(jobs.c.id == job).values(**values))


@pytest.fixture
def tried(api, context):
    """Puts a finished trial in the game, with what engines say of it, into the database."""

    def put(seed: int, success: bool, indicator: float, **engines: dict[str, object]) -> str:
        job = api.post(
            "/v1/jobs", json={"task": "support-1", "model": "builtin/idle", "seed": seed}
        ).json()["id"]
        change(context, job, track=TRACK, **ENDED)
        trial = {"number": 0, "final": True, "engine": "besiege", "machine_hash": "0" * 64}
        trial |= {"success": success, "indicator": indicator, "annotations": engines or None}
        finished = {"job_id": job, "finished_at": datetime.now(UTC)}
        execute(context, insert(rollouts).values(**trial, **finished))
        return job

    return put


def table(api):
    return api.get("/v1/leaderboard/agreement", params={"track": TRACK}).json()


def test_without_trials_in_the_game_the_table_is_empty(api, tried) -> None:
    tried(0, success=True, indicator=5.0)
    assert table(api) == {"track": TRACK, "rows": []}


def test_each_engine_is_compared_with_the_game_on_each_task(api, tried) -> None:
    tried(0, success=True, indicator=100.0, mujoco=said(True, 110.0), pybullet=said(False, 0.0))
    tried(1, success=True, indicator=100.0, mujoco=said(True, 200.0), pybullet=said(True, 100.0))
    tried(2, success=False, indicator=0.0, mujoco=said(False, 0.0))
    mujoco, pybullet = table(api)["rows"]
    assert (mujoco["engine"], mujoco["trials"], mujoco["same_verdict"]) == ("mujoco", 3, 1.0)
    assert mujoco["near"] == 0.5
    assert (pybullet["trials"], pybullet["same_verdict"]) == (2, 0.5)
    assert pybullet["low"] < 0.5 < pybullet["high"]


def test_a_runners_trial_counts_once_it_was_verified(api, context, tried) -> None:
    job = tried(0, success=True, indicator=1.0, mujoco=said(True, 1.0))
    change(context, job, audit="required")
    assert table(api)["rows"] == []
    change(context, job, audit="verified")
    assert len(table(api)["rows"]) == 1


def test_versions_of_our_physics_are_never_mixed() -> None:
    trials = [
        Annotated(task="t", engine="mujoco", version=v, game=(True, 1.0), ours=(True, 1.0))
        for v in ("2", "3", "2")
    ]
    rows = agreement_rows(trials)
    assert [(row.simulation_version, row.trials) for row in rows] == [("2", 2), ("3", 1)]
