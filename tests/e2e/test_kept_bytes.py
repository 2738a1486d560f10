"""Kept means kept: a failing artifact store costs time only, and every lost byte is noticed."""

from pathlib import Path

import pytest
from support.servers.live_api import api_client
from support.servers.stacks import wait_until
from support.stages import work

from buildarena_api.http import parts
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.process.context import Context
from buildarena_backend.trials import trial_repository
from buildarena_simulation import Trajectory, schema_of, write_trajectory
from buildarena_worker.wiring import verifier

SPEC = JobSpec(task="lift-1", model="builtin/expert", simulator="mujoco")


@pytest.fixture
def folder(context: Context) -> Path:
    return Path(context.settings.artifacts_location)


def break_store(folder: Path) -> None:
    """Makes the store fail, for root too: what was its folder is a file."""
    folder.mkdir(parents=True, exist_ok=True)
    folder.rename(folder.with_name("aside"))
    folder.write_text("in the way")


def mend_store(folder: Path) -> None:
    folder.unlink()
    folder.with_name("aside").rename(folder)


def make_due(context: Context) -> None:
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("UPDATE jobs SET available_at = now()")


@pytest.mark.ci
def test_a_failing_store_delays_jobs_and_loses_none(context, submissions, folder) -> None:
    job, _ = submissions.submit_job(SPEC)
    break_store(folder)
    waits = []
    for _ in range(context.settings.max_faults + 2):
        work(context, steps=1)
        with context.store.database.transaction() as connection:
            left = "SELECT extract(epoch FROM available_at - now()) FROM jobs"
            waits.append(float(connection.exec_driver_sql(left).scalar_one()))
        make_due(context)
    waiting = context.store.jobs.get(job.id)
    assert waiting.state == "queued"
    assert "artifacts can't be written" in waiting.detail
    # It asks less and less often, and its model is never asked again.
    assert waits[0] < 3 < waits[3] < waits[6]
    assert waits[-1] == pytest.approx(300, abs=5)
    asked = waiting.requests
    mend_store(folder)
    work(context)
    done = context.store.jobs.get(job.id)
    assert done.outcome == "success"
    assert done.requests == asked


def test_health_says_that_the_store_fails_and_works_again(context, folder, monkeypatch) -> None:
    monkeypatch.setattr(parts, "ARTIFACTS_FRESH_S", 0.0)
    with api_client(context) as api:

        def check() -> dict[str, object]:
            checks = api.get("/v1/health").json()["checks"]
            (found,) = [one for one in checks if one["name"] == "artifacts"]
            return found

        wait_until(lambda: check()["ok"], 20, "it works")
        break_store(folder)
        wait_until(lambda: not check()["ok"], 20, "it is known to fail")
        assert "artifacts can't be written" in check()["detail"]
        mend_store(folder)
        wait_until(lambda: check()["ok"], 20, "it is known to work again")
    assert not list((folder / "probe").iterdir())


@pytest.mark.ci
def test_every_lost_byte_is_noticed(context, submissions, folder) -> None:
    job, _ = submissions.submit_job(SPEC)
    work(context)
    assert verifier(context).verify(job.id).as_document()["ok"]
    with api_client(context, raise_server_exceptions=False) as api:
        for name in ("machine", "transcript", "trajectory-0"):
            digest = context.store.jobs.artifacts(job.id)[name]
            file = folder / digest[:2] / digest
            whole = file.read_bytes()
            damaged = bytearray(whole)
            damaged[len(whole) // 2] ^= 1
            for damage, status, words in (
                ("missing", 404, "not in the store"),
                ("damaged", 500, "is damaged"),
            ):
                file.unlink() if damage == "missing" else file.write_bytes(damaged)
                report = verifier(context).verify(job.id).as_document()
                wrong = {each["name"]: each["found"] for each in report["checks"] if not each["ok"]}
                assert (report["ok"], wrong[f"artifact {name}"]) == (False, damage)
                answer = api.get(f"/v1/jobs/{job.id}/artifacts/{name}")
                assert (answer.status_code, words in answer.json()["detail"]) == (status, True)
            file.write_bytes(whole)


def test_an_agent_can_submit_again_when_the_store_works(context, folder) -> None:
    with api_client(context) as api:
        body = {"task": "support-1", "agent": "mason"}
        session = api.post("/v1/sessions", json=body).json()["id"]
        api.post(f"/v1/sessions/{session}/calls", json={"tool": "start"})
        break_store(folder)
        refused = api.post(f"/v1/sessions/{session}/submit")
        assert refused.status_code == 503
        assert refused.headers["Retry-After"]
        mend_store(folder)
        assert api.post(f"/v1/sessions/{session}/submit").status_code == 200


def test_a_trajectory_of_an_old_schema_is_verified_as_is(context, submissions, monkeypatch) -> None:
    def older(trajectory: Trajectory) -> bytes:
        return write_trajectory(trajectory, schema=2)

    monkeypatch.setattr(trial_repository, "write_trajectory", older)
    job, _ = submissions.submit_job(SPEC)
    work(context)
    kept = context.artifacts.get(context.store.jobs.artifacts(job.id)["trajectory-0"])
    assert schema_of(kept) == 2
    checks = verifier(context).verify(job.id).as_document()["checks"]
    assert [check["name"] for check in checks if not check["ok"]] == []
    assert "rollout 0: trajectory" in {check["name"] for check in checks}
