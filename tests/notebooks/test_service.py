"""What notebooks read of a service is what it keeps; the notebook about it runs."""

import httpx
import pytest
from support.servers.live_api import live_api
from support.stages import work

import buildarena as ba
from buildarena_client import ClientError, NotFoundError, UnreachableError

SWEEP = {
    "name": "three",
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/idle"],
    "seeds": [0],
}


@pytest.fixture
def url(context, monkeypatch):
    with live_api(context) as url:
        httpx.post(f"{url}/v1/sweeps", json=SWEEP).raise_for_status()
        work(context)
        monkeypatch.setenv("BUILDARENA_URL", url)
        yield url


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_boards_and_jobs_are_frames(url, kind):
    board, jobs = ba.leaderboard(kind=kind), ba.jobs(url, kind=kind)
    assert type(board).__module__.startswith(kind)
    by_model = dict(zip(board["model"], board["success_rate"], strict=True))
    assert by_model == {"builtin/expert": 1.0, "builtin/idle": 0.0}
    assert len(jobs) == 2
    assert len(ba.jobs(url, kind=kind, model="builtin/idle")) == 1
    assert len(ba.jobs(url, kind=kind, limit=1)) == 1
    assert list(ba.leaderboard(url, overall=True, kind=kind)["model"]) in (
        [],
        ["builtin/expert", "builtin/idle"],
    )


@pytest.mark.ci
def test_a_job_s_machine_and_trial_are_those_that_are_kept(url):
    jobs = {job["model"]: job for job in httpx.get(f"{url}/v1/jobs").json()["jobs"]}
    good, empty = jobs["builtin/expert"], jobs["builtin/idle"]
    machine, trial = ba.job_machine(good["id"]), ba.job_trial(good["id"], url)
    assert machine.to_document() == httpx.get(f"{url}/v1/jobs/{good['id']}/machine").json()
    assert isinstance(machine, ba.Machine)
    assert trial.machine == machine
    assert (trial.score.success, trial.score.indicator) == (True, good["indicator"])
    again = ba.simulate(machine, trial.task)
    assert again.score == trial.score
    assert "success, load" in trial._repr_mimebundle_()["text/html"]
    for read in (ba.job_machine, ba.job_trial):
        with pytest.raises(ClientError, match=f"{empty['id']} has no .*: plan_unreadable"):
            read(empty["id"])
        with pytest.raises(NotFoundError):
            read("job_00000000000000000000")
        with pytest.raises(ClientError):
            read("../sweeps")


def test_no_service_is_said_so():
    for read in (ba.leaderboard, ba.jobs):
        with pytest.raises(UnreachableError, match=r"127\.0\.0\.1:9"):
            read("http://127.0.0.1:9")
    with pytest.raises(ClientError, match="no kind of frame"):
        ba.jobs("http://127.0.0.1:9", kind="excel", limit=0)
