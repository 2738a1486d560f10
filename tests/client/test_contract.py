"""What both clients say of a real service, and the programs of their README."""

import os
import re
import subprocess
import sys
from itertools import islice
from pathlib import Path

import pytest
from support.clients.tenants import ADMIN
from support.programs import captured

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_benchmark import builtin_tasks
from buildarena_client import (
    BadArgumentError,
    ConflictError,
    ForbiddenError,
    InvalidError,
    KeyRefusedError,
    NotFoundError,
    TimedOutError,
    TooLargeError,
)
from buildarena_geometry import Machine

NOBODY = "job_00000000000000000000"
README = Path(__file__).parents[2] / "clients" / "python" / "README.md"
PROGRAMS = re.findall(r"^```python\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
SAYS = ("lift-1 builtin/expert 1.0", "transcripts", "success_low", "construction_failed", "model")


def test_the_catalogue(client) -> None:
    assert client.health()["checks"]
    assert client.caller()["scopes"][-1] == "admin"
    assert {task["name"] for task in client.tasks()} == builtin_tasks().keys()
    task = client.task("lift-1")
    assert client.task("lift-1", version=task["version"]) == task
    assert "builtin/idle" in [model["name"] for model in client.models()]
    assert client.versions()["family_wise_error_rate"] == 0.05
    assert list(client.workers()) == []


def test_jobs_come_page_after_page_filtered_and_sorted(client, service) -> None:
    assert len(service.jobs) == 6
    for page in (1, 4, 6, 100):
        assert [job["id"] for job in client.jobs(page=page, sweep=service.sweep)] == service.jobs
    assert [job["id"] for job in client.jobs(limit=4, page=3)] == service.jobs[:4]
    assert list(client.jobs(limit=0)) == []
    idle = list(client.jobs(model="builtin/idle", sort="created", order="asc"))
    assert sorted(job["seed"] for job in idle) == [0, 1, 2]
    with pytest.raises(InvalidError, match="unknown task 'lift-9'; choose from") as refused:
        list(client.jobs(task="lift-9"))
    (error,) = refused.value.errors
    assert (refused.value.status, error["field"]) == (422, "task")
    assert "lift-1" in error["choices"]


def test_a_job_and_what_it_left(client, service, tmp_path) -> None:
    job = client.job(service.built)
    assert client.wait_for_job(service.built)["id"] == job["id"]
    assert Machine.from_document(client.machine(service.built)).started
    assert client.transcript(service.built)
    assert client.machine_model(service.built).startswith(b"glTF")
    assert client.trajectory(service.built).startswith(b"PAR1")
    files = {file["name"]: file for file in client.artifacts(service.built)}
    assert job["artifacts"].keys() == files.keys()
    target = tmp_path / "trial.parquet"
    client.download_artifact(service.built, "trajectory-0", target)
    assert target.read_bytes() == client.artifact(service.built, "trajectory-0")
    assert target.stat().st_size == files["trajectory-0"]["size"]
    assert list(tmp_path.iterdir()) == [target]
    with pytest.raises(BadArgumentError, match=r"has no file 'x'; it has .*machine"):
        client.artifact(service.built, "x")
    assert client.thumbnail(service.built).startswith(b"\x89PNG")


def test_the_leaderboard_and_what_stands_beside_it(client, service) -> None:
    assert client.leaderboard()["tasks"][0]["rows"]
    assert client.leaderboard(sweep=[service.sweep], model=["builtin/idle"])
    found = client.compare("builtin/expert", "builtin/idle", task=["lift-1"])
    assert found["tasks"][0]["counted_jobs"] == [3, 3]
    assert b"builtin/idle" in client.export_leaderboard("csv")
    asked = client.verify_leaderboard("builtin/expert", sample=1)
    assert asked["scored"] == 3
    assert client.verification(asked["verification_ids"][0])["id"] == asked["verification_ids"][0]
    again = client.verify_job(service.built)
    with pytest.raises(TimedOutError, match="has not ended within 0 s"):
        client.wait_for_verification(again["id"], timeout_s=0)


def test_sweeps_are_submitted_once_for_each_key(client, service) -> None:
    spec = {"tasks": ["lift-1"], "models": ["builtin/idle"], "seeds": [0, 1]}
    spec["simulator"] = "mujoco"
    key = f"one of {id(client)}"
    first = client.submit_sweep(spec, request_key=key)
    assert client.submit_sweep(spec, request_key=key)["id"] == first["id"]
    with pytest.raises(ConflictError, match="was used for another request"):
        client.submit_sweep({**spec, "seeds": [1]}, request_key=key)
    assert client.submit_sweep(spec)["id"] != first["id"]
    assert client.submit_sweep(spec, resume=True)["resumed"]
    ids = [sweep["id"] for sweep in client.sweeps(page=1)]
    assert ids == [sweep["id"] for sweep in client.sweeps()]
    assert ids[-1] == service.sweep
    assert len(list(client.sweeps(limit=2))) == 2
    # Equal jobs are one.
    job = client.submit_job("lift-1", "builtin/expert", seed=1, simulator="mujoco")
    assert job["id"] in service.jobs


def test_a_sweep_is_a_file(client, tmp_path) -> None:
    file = tmp_path / "sweep.yaml"
    file.write_text("tasks: [lift-1]\nmodels: [builtin/idle]\nsamples: 2\nsimulator: mujoco\n")
    assert client.estimate_sweep(file)["jobs"] == client.submit_sweep(file)["jobs"] == 2
    bad = {"list": "- a\n", "yaml": "a: ["}
    for name, text in bad.items():
        (tmp_path / name).write_text(text)
    for given, says in (
        (tmp_path / "list", "must be a mapping"),
        (tmp_path / "yaml", "is not valid YAML"),
        (tmp_path / "none.yaml", "No such file"),
        (str(file), "give its fields, or the Path"),
    ):
        with pytest.raises(BadArgumentError, match=says):
            client.submit_sweep(given)


def test_a_sweep_is_paused_resumed_cancelled_and_retried(client, make) -> None:
    spec = {"tasks": ["support-1"], "models": ["builtin/idle"]}
    spec["seeds"] = [3 + (make.kind == "sync")]
    sweep = client.submit_sweep(spec)["id"]
    assert client.pause_sweep(sweep)["state"] == "paused"
    assert client.wait_for_sweep(sweep)["state"] == "paused"
    assert client.resume_sweep(sweep, budget={"max_requests": 5})["state"] == "active"
    assert client.set_sweep_budget(sweep, {"max_requests": 7})["budget"]["max_requests"] == 7
    assert client.sweep_forecast(sweep)["remaining_jobs"] == 1
    assert client.job_summary(sweep=sweep)["jobs"] == 1
    assert list(client.search_transcripts("nobody said this", sweep=sweep)) == []
    job = next(iter(client.jobs(sweep=sweep)))["id"]
    with pytest.raises(TimedOutError, match=f"{job} has not ended"):
        client.wait_for_job(job, timeout_s=0)
    with pytest.raises(TimedOutError, match=f"{sweep} has not ended"):
        client.wait_for_sweep(sweep, timeout_s=0)
    with pytest.raises(ConflictError):
        client.retry_job(job)
    assert client.cancel_job(job)["outcome"] == "cancelled"
    assert client.cancel_sweep(sweep)["state"] in {"cancelled", "done"}
    with pytest.raises(ConflictError):
        client.retry_sweep(sweep)


def test_a_sweep_is_waited_for(client, service, make) -> None:
    seeds = [10, 11] if make.kind == "sync" else [12, 13]
    spec = {"tasks": ["lift-1"], "models": ["builtin/idle"], "seeds": seeds, "simulator": "mujoco"}
    sweep = client.submit_sweep(spec)["id"]
    seen = []
    with service.working():
        ended = client.wait_for_sweep(
            sweep, progress=lambda one: seen.append(one["progress"]["done"]), poll_s=0.05
        )
    assert ended["state"] == "done"
    assert ended["progress"]["done"] == seen[-1] == 2
    assert seen == sorted(seen)
    assert [one["state"] for one in client.watch_sweep(sweep)] == ["done"]
    assert len(client.sweep_results(sweep)) == 2
    assert client.sweep_faults(sweep) == []


def test_an_agent_builds_and_submits(client, service, make) -> None:
    opened = client.open_session("lift-1", f"agent-{make.kind}", seed=2, simulator="mujoco")
    again = client.open_session("lift-1", f"agent-{make.kind}", seed=2, simulator="mujoco")
    assert opened["id"] == again["id"]
    with pytest.raises(ConflictError):
        client.submit_session(opened["id"])
    assert client.call_tool(opened["id"], "start")["ok"]
    refused = client.call_tool(opened["id"], "attach_block", {"base_block": 7})
    assert not refused["ok"]
    shown = client.session(opened["id"])
    assert shown["calls"] == 2
    assert shown["open"]
    client.submit_session(opened["id"])
    with service.working():
        assert client.wait_for_job(opened["id"], timeout_s=60)["outcome"] == "construction_failed"


def test_machines_and_tasks_come_as_files(client, service, tmp_path) -> None:
    data = client.artifact(service.built, "machine")
    file, task = tmp_path / "machine.json", tmp_path / "task.yaml"
    file.write_bytes(data)
    assert client.check_machine(file, task="lift-1")["faults"] == []
    tried = client.try_machine(file, task="lift-1", simulator="mujoco", seed=5)
    assert client.try_machine(data, task="lift-1", simulator="mujoco", seed=5)["id"] == tried["id"]
    with pytest.raises(InvalidError, match="file: "):
        client.check_machine(b"no machine")
    with pytest.raises(TooLargeError):
        client.check_machine(b" " * ((2 << 20) + 1))
    task.write_text(EXAMPLE)
    assert client.add_task(EXAMPLE) == client.add_task(task)
    with pytest.raises(InvalidError):
        client.add_task("name: x")


def test_events_are_read_from_anywhere(client, service) -> None:
    first = list(islice(client.sweep_events(service.sweep), 8))
    assert [event["id"] for event in first] == sorted(event["id"] for event in first)
    assert {event["sweep_id"] or event["job_id"] for event in first}
    behind = list(islice(client.sweep_events(service.sweep, after=first[3]["id"]), 4))
    assert behind == first[4:]
    own = next(iter(client.job_events(service.built)))
    assert own["job_id"] == service.built
    with pytest.raises(NotFoundError):
        next(iter(client.job_events(NOBODY)))


def test_what_is_not_there_or_not_allowed(make, service) -> None:
    admin = make(service.locked, ADMIN)
    for ask in (admin.job, admin.machine, admin.replay, admin.artifacts, admin.session):
        with pytest.raises(NotFoundError):
            ask(NOBODY)
    made = admin.post("/v1/keys", {"name": f"reads-{make.kind}", "scopes": ["read"]})
    reader = make(service.locked, made["secret"])
    assert reader.caller()["scopes"] == ["read"]
    with pytest.raises(ForbiddenError, match="needs the scope 'submit'"):
        reader.submit_job("lift-1", "builtin/idle")
    for key in (None, "unknown"):
        with pytest.raises(KeyRefusedError, match="API key"):
            make(service.locked, key).tasks()


def test_the_key_and_the_url_may_stand_in_the_environment(make, service, monkeypatch, tmp_path):
    monkeypatch.setenv("BUILDARENA_URL", service.locked + "/")
    monkeypatch.setenv("BUILDARENA_KEY", ADMIN)
    assert make().caller()["scopes"][-1] == "admin"
    file = tmp_path / "key"
    file.write_text(f"{ADMIN}\n")
    monkeypatch.setenv("BUILDARENA_KEY_FILE", str(file))
    with pytest.raises(BadArgumentError, match="are both set"):
        make()
    monkeypatch.delenv("BUILDARENA_KEY")
    assert make().caller()["scopes"][-1] == "admin"


def ran(program: str, url: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-c", program]
    variables = {**os.environ, "BUILDARENA_URL": url}
    return captured(command, env=variables, within_s=100)


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("program", "says"), list(zip(PROGRAMS, SAYS, strict=True)), ids=SAYS)
def test_a_program_of_the_readme_does_what_it_says(service, program, says) -> None:
    with service.working():
        done = ran(program, service.url)
    assert (done.returncode, done.stderr) == (0, "")
    assert says in done.stdout
