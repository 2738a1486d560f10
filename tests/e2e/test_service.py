"""A whole service: processes are killed, keys are replaced, and nothing is lost."""

import json
import os
import signal
import threading
from contextlib import ExitStack

import httpx
import pytest
from pydantic import SecretStr
from support.clients.commands import run_cli
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import live_api
from support.servers.stacks import finished, results, running_stack, wait_until
from support.stages import work

from buildarena_backend.process.context import open_context

NEW_ADMIN = "another-operator-secret-as-long"
SWEEP = {
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/random", "builtin/idle"],
    "seeds": [0, 1],
    "simulator": "mujoco",
}


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


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


@pytest.mark.ci
def test_keys_are_replaced_under_a_running_sweep(context) -> None:
    """The operator's and a researcher's; no job is lost by it."""
    with ExitStack() as stack:

        def api(**changes: object) -> httpx.Client:
            own = open_context(context.settings.model_copy(update={**WITH_KEYS, **changes}))
            stack.callback(own.close)
            url = stack.enter_context(live_api(own))
            return stack.enter_context(httpx.Client(base_url=url, timeout=30))

        # While the API's processes are replaced one by one, some know the old key alone.
        old = api()
        new = api(admin_key=SecretStr(NEW_ADMIN), previous_admin_key=SecretStr(ADMIN))
        last = api(admin_key=SecretStr(NEW_ADMIN))
        body = {"name": "ada", "scopes": ["submit"]}
        key = old.post("/v1/keys", json=body, headers=bearer(ADMIN)).json()
        sweep = {**SWEEP, "models": ["builtin/idle"]}
        made = old.post("/v1/sweeps", json=sweep, headers=bearer(key["secret"])).json()
        working = threading.Thread(target=work, args=(context,), kwargs={"threads": 2})
        working.start()
        allowed = [
            [each.get("/v1/keys", headers=bearer(secret)).status_code for each in (old, new, last)]
            for secret in (ADMIN, NEW_ADMIN)
        ]
        assert allowed == [[200, 200, 401], [401, 200, 200]]
        path = f"/v1/keys/{key['id']}/rotate"
        again = new.post(path, json={"overlap_hours": 1}, headers=bearer(NEW_ADMIN)).json()
        for each in (old, new, last):
            for secret in (key["secret"], again["secret"]):
                assert each.get("/v1/tasks", headers=bearer(secret)).status_code == 200
        # What the key submitted before is still its holder's own.
        path = f"/v1/sweeps/{made['id']}"
        for action in ("pause", "resume"):
            changed = last.post(f"{path}/{action}", json={}, headers=bearer(again["secret"]))
            assert changed.status_code == 200, changed.text
        working.join()
        work(context)
        progress = last.get(path, headers=bearer(again["secret"])).json()["progress"]
        assert progress["done"] == progress["total"] == 2
        assert "errored" not in progress["outcomes"]
