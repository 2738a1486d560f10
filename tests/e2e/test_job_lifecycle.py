"""The whole road with its real parts: servers, API, workers and simulator as processes."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from support.clients.commands import run_cli
from support.servers.stacks import finished, results, running_stack, wait_until

SWEEP = {
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/random", "builtin/idle"],
    "seeds": [0, 1],
    "simulator": "mujoco",
}
# One process runs the undisturbed sweep once for both tests.
BUILDARENA = str(Path(sys.executable).parent / "buildarena")


def run_process(url: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [BUILDARENA, *words, "--url", url], capture_output=True, text=True, check=False, timeout=120
    )


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, object]]:
    """Results of a sweep on a service that nobody harms, looked at through the command line."""
    with running_stack(tmp_path_factory.mktemp("undisturbed")) as stack:
        file = stack.settings.data / "sweep.yaml"
        file.write_text(json.dumps(SWEEP))
        ran = run_process(stack.url, "sweep", "run", str(file), "--json")
        assert ran.returncode == 0, ran.stderr
        sweep_id = json.loads(ran.stdout)["id"]
        with httpx.Client(base_url=stack.url) as client:
            found = results(client, sweep_id)
        _look_with_the_command_line(stack.url, sweep_id, str(found[0]["id"]))
    return found


def _look_with_the_command_line(url: str, sweep_id: str, job_id: str) -> None:
    """Commands that only ask take no process of their own: its start takes longer than they."""
    status = json.loads(run_cli(url, "sweep", "status", sweep_id, "--json").stdout)
    assert status["state"] == "done"
    board = json.loads(run_cli(url, "leaderboard", "--json").stdout)
    assert board["tasks"][0]["rows"][0]["model"] == "builtin/expert"
    assert "builtin/expert*" in run_cli(url, "leaderboard").stdout
    assert json.loads(run_cli(url, "job", "show", job_id, "--json").stdout)["id"] == job_id
    doctor = run_cli(url, "doctor", "--json")
    assert json.loads(doctor.stdout)["checks"][0]["ok"]
    listed = json.loads(run_cli(url, "job", "list", "--sweep", sweep_id, "--json").stdout)
    assert job_id in {job["id"] for job in listed["jobs"]}
    assert run_cli(url, "job", "logs", job_id).stdout.startswith("# support-1 by builtin/")
    assert "support-1" in run_cli(url, "task", "list").stdout
    assert "cargo" in run_cli(url, "task", "show", "support-1").stdout
    assert "builtin/expert*" in run_cli(url, "model", "list").stdout
    retried = run_cli(url, "job", "retry", job_id)
    assert (retried.returncode, "only errored jobs" in retried.stderr) == (1, True)
    verified = run_cli(url, "job", "verify", job_id)
    assert verified.returncode == 0, verified.stdout
    assert "Every figure is the same." in verified.stdout
    nobodys = "job_00000000000000000000"
    unknown = run_cli(url, "job", "show", nobodys)
    assert (unknown.returncode, unknown.stderr.strip()) == (1, f"there is no job {nobodys!r}")


@pytest.mark.ci
def test_the_expert_succeeds_and_the_other_baselines_do_not(undisturbed) -> None:
    outcomes = [job["outcome"] for job in undisturbed]
    assert outcomes.count("success") == 2
    assert len(outcomes) == 6
    assert not {"errored", "cancelled"} & set(outcomes)


@pytest.mark.ci
def test_killed_processes_lose_nothing_and_change_no_result(undisturbed, tmp_path) -> None:
    with running_stack(tmp_path) as stack, httpx.Client(base_url=stack.url, timeout=30) as client:
        sweep_id = client.post("/v1/sweeps", json=SWEEP).json()["id"]
        processes = {managed.name: managed for managed in stack.supervisor.managed}

        def progress() -> dict[str, int]:
            stages: dict[str, int] = client.get(f"/v1/sweeps/{sweep_id}").json()["progress"][
                "stages"
            ]
            return stages

        def kill(name: str) -> None:
            victim = processes[name].process
            assert victim is not None
            os.kill(victim.pid, signal.SIGKILL)
            wait_until(lambda: processes[name].process is not victim, 30, f"{name} started again")

        wait_until(lambda: progress().get("construct running"), 60, "a session runs")
        kill("construct worker")
        kill("valkey")
        wait_until(lambda: progress().get("simulate running"), 60, "a simulation runs")
        kill("mujoco worker")
        finished(client, sweep_id)
        disturbed = results(client, sweep_id)
        for job in disturbed:
            attempts = client.get(f"/v1/jobs/{job['id']}").json()["attempts"]
            assert sum(attempt["result"] == "done" for attempt in attempts) <= 2
    assert disturbed == undisturbed
