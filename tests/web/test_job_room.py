"""The job's page against what really happens: random machines, live sessions, processes killed."""

import json

import httpx
import psutil
import pytest
from support.documents.pages import in_browser, needs_pages
from support.marks import nightly
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import finished, running_stack
from tests.web.random_machines import built_session

pytestmark = [*needs_pages, pytest.mark.ci]

LATENCY_S = 0.3
SWEEP = {
    "name": "room",
    "tasks": ["support-1"],
    "models": ["builtin/expert"],
    "seeds": [0, 1],
    "simulator": "mujoco",
}


def processes(*names: str) -> str:
    """Ids of the service's processes with one of these words among theirs."""
    found = []
    for process in psutil.Process().children(recursive=True):
        words = process.cmdline()
        if any(any(name in word for word in words) for name in names):
            found.append(str(process.pid))
    assert found
    return ",".join(found)


@pytest.mark.parametrize(("machines", "a_session"), [(8, 4), nightly(50, 10)])
def test_the_room_of_a_job_shows_what_is(tmp_path, machines, a_session) -> None:
    with running_stack(tmp_path) as stack:
        with httpx.Client(base_url=stack.url, timeout=30) as client:
            sweep = client.post("/v1/sweeps", json=SWEEP).raise_for_status().json()["id"]
            groups = [range(k, k + a_session) for k in range(0, machines, a_session)]
            sessions = [built_session(client, f"random-{g[0]}", g) for g in groups]
            finished(client, sweep)
        assert any(step["ghosts"] for session in sessions for step in session["steps"])
        file = tmp_path / "machines.json"
        file.write_text(json.dumps(sessions))
        in_browser(stack.url, ["e2e/room"], BUILDARENA_WEB_MACHINES=str(file))


@pytest.mark.nightly
def test_a_session_is_watched_while_processes_die(tmp_path) -> None:
    with ProviderStandIn("expert", latency_s=LATENCY_S) as standin:
        models = tmp_path / "models.yaml"
        models.write_text(
            f"providers:\n  standin: {{protocol: openai, base_url: '{standin.url}/v1'}}\n"
            "models:\n  - {name: standin/expert, provider: standin, model: expert}\n"
        )
        with running_stack(tmp_path, models_file=models) as stack:
            payload = {"task": "support-1", "model": "standin/expert", "simulator": "mujoco"}
            job = httpx.post(f"{stack.url}/v1/jobs", json=payload).raise_for_status().json()["id"]
            print(  # noqa: T201 - the measured figures, for who asks with -s
                in_browser(
                    stack.url,
                    ["e2e/live"],
                    BUILDARENA_WEB_PLAYED=job,
                    BUILDARENA_WEB_WORKERS=processes("buildarena_worker"),
                    BUILDARENA_WEB_APIS=processes("buildarena_api"),
                )
            )
