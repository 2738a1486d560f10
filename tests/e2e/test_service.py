"""A whole service: processes are killed, keys are replaced, and nothing is lost."""

import json
import os
import signal

import httpx
import pytest
from support.clients.commands import run_cli
from support.servers.live_api import live_api
from support.servers.stacks import finished, results, running_stack, wait_until
from support.stages import work

SWEEP = {"tasks": ["support-1"], "seeds": [0, 1], "simulator": "mujoco"}
SWEEP["models"] = ["builtin/expert", "builtin/random", "builtin/idle"]


@pytest.mark.ci
def test_killed_processes_lose_nothing_and_change_no_result(context, tmp_path) -> None:
    """What a service comes to whose processes are killed is what this process alone comes to."""
    with live_api(context) as url, httpx.Client(base_url=url, timeout=30) as client:
        alone_id = client.post("/v1/sweeps", json=SWEEP).json()["id"]
        work(context)
        undisturbed = results(client, alone_id)
    assert sorted(str(job["outcome"]) for job in undisturbed).count("success") == 2
    assert {job["outcome"] for job in undisturbed}.isdisjoint({"errored", "cancelled"})
    with running_stack(tmp_path) as stack, httpx.Client(base_url=stack.url, timeout=30) as client:
        sweep_id = client.post("/v1/sweeps", json=SWEEP).json()["id"]
        processes = {managed.name: managed for managed in stack.supervisor.managed}

        def progress() -> dict[str, int]:
            return dict(client.get(f"/v1/sweeps/{sweep_id}").json()["progress"]["stages"])

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
        status = json.loads(run_cli(stack.url, "sweep", "status", sweep_id, "--json").stdout)
        assert status["state"] == "done"
        assert "builtin/expert*" in run_cli(stack.url, "leaderboard").stdout
        verified = run_cli(stack.url, "job", "verify", str(disturbed[0]["id"]))
        assert "Every figure is the same." in verified.stdout
    assert disturbed == undisturbed
