from collections.abc import Callable, Iterator
from typing import Any

import pytest
from starlette.testclient import TestClient
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import api_client, changed, live_api

from buildarena_backend.process.context import Context, open_context


@pytest.fixture
def api(context: Context) -> Iterator[TestClient]:
    """The API in this process, on the real database and broker."""
    with api_client(context, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def guarded(context: Context) -> Iterator[TestClient]:
    """The API with keys asked for; requests carry none by themselves."""
    with (
        changed(context, **WITH_KEYS) as own,
        api_client(own, raise_server_exceptions=False) as client,
    ):
        yield client


@pytest.fixture
def guarded_url(context: Context) -> Iterator[str]:
    """The same over real HTTP, with as many connections as the API's process has."""
    own = open_context(context.settings.model_copy(update=WITH_KEYS), pool_size=10)
    with live_api(own) as found:
        yield found
    own.close()


@pytest.fixture
def sweep() -> dict[str, object]:
    return {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1]}


@pytest.fixture
def submit_job(api: TestClient) -> Callable[..., str]:
    """Submits a job; its id."""

    def submit(task: str = "support-1", model: str = "builtin/expert", **more: Any) -> str:
        body = {"task": task, "model": model, "simulator": "mujoco", **more}
        answer = api.post("/v1/jobs", json=body)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    return submit


@pytest.fixture
def open_session(api: TestClient) -> Callable[..., str]:
    """Opens an agent's session; its id."""

    def open_one(**more: Any) -> str:
        body = {"task": "support-1", "agent": "me", "seed": 1, "simulator": "mujoco", **more}
        answer = api.post("/v1/sessions", json=body)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    return open_one


@pytest.fixture
def act(api: TestClient) -> Callable[..., Any]:
    """Calls a tool in a session; what it answers."""

    def call(session: str, tool: str, arguments: object, machine: str = "main") -> Any:
        body = {"tool": tool, "arguments": arguments, "machine": machine}
        answer = api.post(f"/v1/sessions/{session}/calls", json=body)
        assert answer.status_code == 200, answer.text
        return answer.json()

    return call
