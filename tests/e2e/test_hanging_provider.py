"""A whole service with two keys: the sessions of one hang, those of the other go on."""

import time

import httpx
import pytest
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import models_file
from support.servers.stacks import running_stack, wait_until

SESSIONS = 8


@pytest.mark.ci
@pytest.mark.timeout(120)
def test_hanging_sessions_of_one_key_leave_room_for_another_s(tmp_path) -> None:
    for folder in (tmp_path, *tmp_path.parents[:3]):
        folder.chmod(folder.stat().st_mode | 0o055)  # Postgres runs as nobody under root
    with (
        ProviderStandIn(fault=lambda _: "hang") as bad,
        ProviderStandIn() as good,
        running_stack(
            tmp_path,
            models_file=models_file(tmp_path, {"bad": bad, "good": good}),
            sessions_per_worker=SESSIONS,
            require_keys=True,
            lease_s=10.0,
        ) as stack,
        httpx.Client(base_url=stack.url, timeout=30) as client,
    ):
        admin = {"Authorization": f"Bearer {stack.admin_key}"}

        def key(name: str) -> dict[str, str]:
            payload = {"name": name, "scopes": ["read", "submit"]}
            made = client.post("/v1/keys", json=payload, headers=admin)
            assert made.status_code == 201, made.text
            return {"Authorization": f"Bearer {made.json()['secret']}"}

        def submit(provider: str, jobs: int, owner: dict[str, str]) -> str:
            payload = {
                "tasks": ["lift-1"],
                "models": [f"{provider}/expert"],
                "samples": jobs,
                "simulator": "mujoco",
            }
            answer = client.post("/v1/sweeps", json=payload, headers=owner)
            assert answer.status_code == 202, answer.text
            return str(answer.json()["id"])

        hostile, innocent = key("hostile"), key("innocent")
        hanging = submit("bad", 3 * SESSIONS, hostile)
        wait_until(lambda: bad.counts.requests == SESSIONS, 20, "one key has what is configured")
        submitted = time.monotonic()
        submit("good", 1, innocent)
        wait_until(lambda: good.counts.requests, 2, "the other key's session has begun")
        waited_s = time.monotonic() - submitted
        assert bad.counts.requests == SESSIONS
        assert waited_s < 2
        cancelled = client.post(f"/v1/sweeps/{hanging}/cancel", json={}, headers=hostile)
        assert cancelled.status_code == 200, cancelled.text
        wait_until(lambda: bad.left == SESSIONS, 3, "all hanging requests have ended")
