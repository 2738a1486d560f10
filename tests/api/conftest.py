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
    quiet = {"raise_server_exceptions": False}
    with changed(context, **WITH_KEYS) as own, api_client(own, **quiet) as client:
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


def posted(api: TestClient, path: str, body: dict[str, Any]) -> Any:
    """What is answered to something that is accepted."""
    answer = api.post(path, json=body)
    assert answer.is_success, answer.text
    return answer.json()


@pytest.fixture
def submit_job(api: TestClient) -> Callable[..., str]:
    """Submits a job; its id."""
    usual = {"task": "support-1", "model": "builtin/expert", "simulator": "mujoco"}
    return lambda **more: str(posted(api, "/v1/jobs", usual | more)["id"])


@pytest.fixture
def open_session(api: TestClient) -> Callable[..., str]:
    """Opens an agent's session; its id."""
    usual = {"task": "support-1", "agent": "me", "seed": 1, "simulator": "mujoco"}
    return lambda **more: str(posted(api, "/v1/sessions", usual | more)["id"])


@pytest.fixture
def act(api: TestClient) -> Callable[..., Any]:
    """Calls a tool in a session; what it answers."""

    def call(session: str, tool: str, arguments: object, machine: str = "main") -> Any:
        body = {"tool": tool, "arguments": arguments, "machine": machine}
        return posted(api, f"/v1/sessions/{session}/calls", body)

    return call
