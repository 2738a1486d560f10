"""Keys, scopes, owners and rate limits."""

import pytest
from pydantic import SecretStr
from support.clients.tenants import ADMIN, WITH_KEYS, Tenant, new_tenant, operator
from support.jobs import execute
from support.servers.live_api import api_client, changed
from support.servers.stacks import wait_until

from buildarena_api.access import check_binding
from buildarena_backend.settings import Settings

METRICS = "a-key-for-prometheus-alone"
NEW_ADMIN = "another-operator-secret-as-long"


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


def test_without_a_good_key_only_health_and_the_contract_answer(guarded) -> None:
    secrets = ["", "nonsense", "ba_", "ba_" + "x" * 43, "ü", "ba_'; DROP TABLE api_keys; --"]
    for path in ("/v1/health", "/openapi.json", "/jobs/job_1"):
        assert guarded.get(path).status_code == 200
    for path in ("/v1/tasks", "/v1/jobs", "/v1/leaderboard", "/v1/keys", "/v1/jobs/job_x/replay"):
        for secret in (None, *(secrets if path == "/v1/tasks" else ())):
            headers = {} if secret is None else {"Authorization": f"Bearer {secret}".encode()}
            answer = guarded.get(path, headers=headers)
            assert answer.status_code == 401, (path, secret)
            assert answer.headers["www-authenticate"] == "Bearer"
            assert answer.headers["content-type"] == "application/problem+json"
    assert operator(guarded).get("/v1/keys")["data"] == []


def test_expired_and_revoked_keys_are_refused_and_say_so(guarded, context) -> None:
    mine, other = new_tenant(guarded, "mine"), new_tenant(guarded, "other", "admin")
    assert mine.ask("GET", "/v1/jobs").status_code == 200
    execute(context, "UPDATE api_keys SET expires_at = now() WHERE id = :id", {"id": mine.id})

    def refused() -> str:
        return mine.ask("GET", "/v1/jobs").json().get("detail", "")

    assert "expired" in wait_until(refused, 5, "a key that expired is refused")
    assert other.ask("GET", "/v1/keys").status_code == 200
    operator(guarded).post(f"/v1/keys/{other.id}/revoke")
    answer = other.ask("GET", "/v1/keys")
    assert (answer.status_code, "revoked" in answer.json()["detail"]) == (401, True)


def test_each_scope_allows_its_part_and_is_told(guarded, api, sweep) -> None:
    def tried(who: Tenant) -> list[int]:
        new = {"name": "x", "scopes": ["admin"]}
        asked = (("GET", "/v1/tasks", None), ("POST", "/v1/sweeps", sweep))
        asked += (("GET", "/v1/keys", None), ("POST", "/v1/keys", new))
        return [who.ask(method, path, json=body).status_code for method, path, body in asked]

    for scopes, statuses in (
        (["read"], [200, 403, 403, 403]),
        (["read", "submit"], [200, 201, 403, 403]),
        (["read", "submit", "admin"], [200, 201, 200, 201]),
    ):
        who = new_tenant(guarded, "ada", *scopes)
        assert tried(who) == statuses
        told = {"key_id": who.id, "scopes": scopes, "keys_required": True}
        assert who.get("/v1/caller") == told
    answer = api.get("/v1/caller")
    scopes = ["read", "submit", "admin"]
    assert answer.json() == {"key_id": None, "scopes": scopes, "keys_required": False}
    assert answer.headers["cache-control"] == "no-store"


def test_nobody_changes_what_another_submitted(guarded, sweep) -> None:
    mine, other = (new_tenant(guarded, name, "read", "submit") for name in ("mine", "other"))
    id_ = mine.post("/v1/sweeps", sweep)["id"]
    job = mine.get("/v1/jobs")["data"][0]["id"]
    session = mine.post("/v1/sessions", {"task": "support-1", "agent": "me"})["id"]
    call = {"tool": "start", "arguments": {}}
    budget = f"/v1/sweeps/{id_}/budget"
    changes = [
        *(
            ("POST", f"/v1/sweeps/{id_}/{do}", None)
            for do in ("pause", "resume", "cancel", "retry")
        ),
        *(("POST", f"/v1/jobs/{job}/{what}", None) for what in ("cancel", "retry")),
        *(("POST", f"/v1/sessions/{session}/{what}", call) for what in ("calls", "submit")),
        ("POST", f"/v1/sessions/{session}/test-trials", None),
        ("PUT", budget, {"max_requests": 9}),
    ]
    for method, path, body in changes:
        answer = other.ask(method, path, json=body)
        assert answer.status_code == 403, path
        assert "another key" in answer.json()["detail"]
    assert other.get(f"/v1/sweeps/{id_}")["state"] == "active"
    assert other.get(f"/v1/sessions/{session}")["open"]
    mine.post(f"/v1/sessions/{session}/calls", call, status=200)
    assert mine.ask("PUT", budget, json={"max_requests": 7}).json()["budget"]["max_requests"] == 7
    assert mine.ask("PUT", budget, json={"usd": 1}).status_code == 422
    mine.post(f"/v1/sweeps/{id_}/pause", status=200)
    operator(guarded).post(f"/v1/sweeps/{id_}/cancel", status=200)
    assert mine.ask("PUT", budget, json={}).status_code == 409


def test_one_keys_idempotency_keys_are_not_anothers(guarded, sweep) -> None:
    headers = {"Idempotency-Key": "monday"}
    who = [new_tenant(guarded, "x") for _ in range(2)]
    made = [one.ask("POST", "/v1/sweeps", json=sweep, headers=headers).json() for one in who]
    assert made[0]["id"] != made[1]["id"]


def test_a_secret_is_shown_once_and_nowhere_again(guarded, capfd) -> None:
    who = new_tenant(guarded, "somebody")
    who.ask("GET", "/v1/nonsense")
    guarded.get("/v1/tasks", headers=bearer(who.secret + "x"))
    listed = operator(guarded).ask("GET", "/v1/keys").text
    settings = Settings().model_copy(update={"admin_key": SecretStr(ADMIN)})
    for place in (listed, repr(settings), *capfd.readouterr()):
        assert who.secret not in place
        assert ADMIN not in place


def test_too_many_requests_are_reported_when_to_come_back(context) -> None:
    with changed(context, rate_limit="5/minute") as own, api_client(own) as client:
        answers = [client.get("/v1/models") for _ in range(7)]
        assert [answer.status_code for answer in answers] == [200] * 5 + [429] * 2
        assert 1 <= int(answers[-1].headers["retry-after"]) <= 60
        assert client.get("/v1/health").status_code == 200, "probes are not counted"
    limited = {**WITH_KEYS, "rate_limit": "3/minute"}
    with changed(context, **limited) as own, api_client(own) as client:
        tried = [client.get("/v1/tasks", headers=bearer(f"ba_{n}")).status_code for n in range(5)]
        assert tried == [401, 401, 401, 429, 429], "guessing keys is limited"
        assert operator(client).ask("GET", "/v1/tasks").status_code == 200


def test_an_operators_key_is_replaced_process_by_process(context) -> None:
    """While the API's processes are replaced one by one, some know the old key alone."""
    new = {"admin_key": SecretStr(NEW_ADMIN)}
    for changes, allowed in (
        ({}, [200, 401]),
        ({**new, "previous_admin_key": SecretStr(ADMIN)}, [200, 200]),
        (new, [401, 200]),
    ):
        with changed(context, **WITH_KEYS | changes) as own, api_client(own) as client:
            tried = [client.get("/v1/keys", headers=bearer(key)) for key in (ADMIN, NEW_ADMIN)]
            assert [answer.status_code for answer in tried] == allowed


def test_an_open_service_stays_on_loopback() -> None:
    check_binding(Settings())
    for changes, advice in (
        ({"host": "0.0.0.0"}, "BUILDARENA_REQUIRE_KEYS=true"),
        ({"require_keys": True}, "BUILDARENA_ADMIN_KEY"),
    ):
        with pytest.raises(ValueError, match=advice):
            check_binding(Settings().model_copy(update=changes))


def test_the_key_of_the_metrics_opens_them_alone(context) -> None:
    changes = {**WITH_KEYS, "metrics_key": SecretStr(METRICS), "base_path": "/arena"}
    with changed(context, **changes) as own, api_client(own) as client:
        for secret, path, status in (
            *((METRICS, path, 200) for path in ("/v1/metrics", "/arena/v1/metrics")),
            *((METRICS, path, 401) for path in ("/v1/jobs", "/v1/keys", "/v1/tasks")),
            (METRICS + "x", "/v1/metrics", 401),
            (ADMIN, "/v1/metrics", 200),
        ):
            assert client.get(path, headers=bearer(secret)).status_code == status, (secret, path)
        assert client.get("/v1/metrics").status_code == 401
        assert client.post("/v1/metrics", headers=bearer(METRICS)).status_code == 405
