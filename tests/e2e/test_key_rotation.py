"""The operator's key and a researcher's are replaced while a sweep runs; no job is lost by it."""

import threading
from contextlib import ExitStack

import httpx
import pytest
from pydantic import SecretStr
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import live_api
from support.stages import work

from buildarena_pipeline.runtime.context import open_context

NEW_ADMIN = "another-operator-secret-as-long"
SWEEP = {
    "tasks": ["lift-1", "support-1"],
    "models": ["builtin/idle"],
    "seeds": [0, 1, 2],
    "simulator": "mujoco",
}


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.mark.ci
def test_keys_are_replaced_under_a_running_sweep(context) -> None:
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
        made = old.post("/v1/sweeps", json=SWEEP, headers=bearer(key["secret"])).json()
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
        shown = last.get(path, headers=bearer(again["secret"])).json()
        assert shown["progress"]["done"] == shown["progress"]["total"] == 6
        assert "errored" not in shown["progress"]["outcomes"]
