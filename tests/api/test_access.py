"""Keys, scopes, owners and rate limits."""

import pytest
from pydantic import SecretStr
from support.clients.tenants import ADMIN, WITH_KEYS
from support.jobs import execute
from support.servers.live_api import api_client, changed
from support.servers.stacks import wait_until

from buildarena_api.http.access import check_binding
from buildarena_pipeline.runtime.settings import Settings

CHANGES = [
    *(f"/v1/sweeps/{{sweep}}/{what}" for what in ("pause", "resume", "cancel", "retry")),
    *(f"/v1/jobs/{{job}}/{what}" for what in ("cancel", "retry")),
]


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.fixture
def make_key(guarded) -> object:
    def make(*scopes: str, **more: object) -> str:
        body = {"name": "somebody", "scopes": list(scopes), **more}
        answer = guarded.post("/v1/keys", json=body, headers=bearer(ADMIN))
        assert answer.status_code == 201, answer.text
        return answer.json()["secret"]

    return make


def test_without_a_key_only_health_and_the_contract_answer(guarded) -> None:
    assert guarded.get("/v1/health").status_code == 200
    assert guarded.get("/openapi.json").status_code == 200
    for path in ("/v1/tasks", "/v1/jobs", "/v1/leaderboard", "/v1/keys", "/v1/sweeps"):
        answer = guarded.get(path)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == "Bearer"
        assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    "secret", ["", "nonsense", "ba_", "ba_" + "x" * 43, "ü", "ba_'; DROP TABLE api_keys; --"]
)
def test_malformed_and_unknown_keys_are_refused(guarded, secret) -> None:
    headers = {"Authorization": f"Bearer {secret}".encode()}
    assert guarded.get("/v1/tasks", headers=headers).status_code == 401
    assert guarded.get("/v1/keys", headers=bearer(ADMIN)).json() == []


def test_expired_and_revoked_keys_are_refused_and_say_so(guarded, make_key, context) -> None:
    secret = make_key("submit", days=1)
    assert guarded.get("/v1/jobs", headers=bearer(secret)).status_code == 200
    execute(context, "UPDATE api_keys SET expires_at = now()")

    def refused() -> str:
        return guarded.get("/v1/jobs", headers=bearer(secret)).json().get("detail", "")

    assert "expired" in wait_until(refused, 5, "a key that expired is refused")
    other = make_key("admin")
    key_id = guarded.get("/v1/keys", headers=bearer(other)).json()[-1]["id"]
    assert guarded.post(f"/v1/keys/{key_id}/revoke", headers=bearer(ADMIN)).status_code == 200
    answer = guarded.get("/v1/jobs", headers=bearer(other))
    assert (answer.status_code, "revoked" in answer.json()["detail"]) == (401, True)


def test_each_scope_allows_its_part(guarded, make_key, sweep) -> None:
    def tried(secret: str) -> list[int]:
        headers = bearer(secret)
        return [
            guarded.get("/v1/tasks", headers=headers).status_code,
            guarded.post("/v1/sweeps", json=sweep, headers=headers).status_code,
            guarded.get("/v1/keys", headers=headers).status_code,
            guarded.post(
                "/v1/keys", json={"name": "x", "scopes": ["admin"]}, headers=headers
            ).status_code,
        ]

    assert tried(make_key("read")) == [200, 403, 403, 403]
    assert tried(make_key("submit")) == [200, 202, 403, 403]
    assert tried(make_key("admin")) == [200, 202, 200, 201]


def test_nobody_changes_what_another_submitted(guarded, make_key, sweep) -> None:
    mine, other = make_key("submit"), make_key("submit")
    sweep_id = guarded.post("/v1/sweeps", json=sweep, headers=bearer(mine)).json()["id"]
    job_id = guarded.get("/v1/jobs", headers=bearer(mine)).json()["jobs"][0]["id"]
    for path in CHANGES:
        url = path.format(sweep=sweep_id, job=job_id)
        answer = guarded.post(url, headers=bearer(other))
        assert answer.status_code == 403, url
        assert "another key" in answer.json()["detail"]
    shown = guarded.get(f"/v1/sweeps/{sweep_id}", headers=bearer(other)).json()
    assert shown["state"] == "active"
    assert guarded.post(f"/v1/sweeps/{sweep_id}/pause", headers=bearer(mine)).status_code == 200
    assert guarded.post(f"/v1/sweeps/{sweep_id}/cancel", headers=bearer(ADMIN)).status_code == 200


def test_nobody_plays_anothers_session(guarded, make_key) -> None:
    mine, other = make_key("submit"), make_key("submit")
    payload = {"task": "support-1", "agent": "me"}
    opened = guarded.post("/v1/sessions", json=payload, headers=bearer(mine)).json()["id"]
    call = {"tool": "start", "arguments": {}}
    for path, body in (("calls", call), ("submit", None)):
        url = f"/v1/sessions/{opened}/{path}"
        assert guarded.post(url, json=body, headers=bearer(other)).status_code == 403
    answer = guarded.post(f"/v1/sessions/{opened}/calls", json=call, headers=bearer(mine))
    assert answer.status_code == 200


def test_one_keys_idempotency_keys_are_not_anothers(guarded, make_key, sweep) -> None:
    ids = set()
    for secret in (make_key("submit"), make_key("submit")):
        headers = {**bearer(secret), "Idempotency-Key": "monday"}
        ids.add(guarded.post("/v1/sweeps", json=sweep, headers=headers).json()["id"])
    assert len(ids) == 2


def test_a_secret_is_shown_once_and_nowhere_again(guarded, make_key, capfd) -> None:
    secret = make_key("submit")
    guarded.get("/v1/nonsense", headers=bearer(secret))
    guarded.get("/v1/tasks", headers=bearer(secret + "x"))
    listed = guarded.get("/v1/keys", headers=bearer(ADMIN)).text
    out, err = capfd.readouterr()
    for place in (listed, out, err):
        assert secret not in place
        assert ADMIN not in place


def test_settings_do_not_print_the_operators_key(context) -> None:
    changed = context.settings.model_copy(update={"admin_key": SecretStr(ADMIN)})
    assert ADMIN not in repr(changed)


def test_too_many_requests_are_reported_when_to_come_back(context) -> None:
    with changed(context, rate_limit="5/minute") as own, api_client(own) as client:
        answers = [client.get("/v1/models") for _ in range(7)]
        assert [answer.status_code for answer in answers][:5] == [200] * 5
        assert answers[-1].status_code == 429
        assert 1 <= int(answers[-1].headers["retry-after"]) <= 60
        assert client.get("/v1/health").status_code == 200, "probes are not counted"


@pytest.mark.ci
def test_guessing_keys_is_limited(context) -> None:
    changes = {**WITH_KEYS, "rate_limit": "3/minute"}
    with changed(context, **changes) as own, api_client(own) as client:
        tried = [client.get("/v1/tasks", headers=bearer(f"ba_{n}")).status_code for n in range(5)]
        assert tried == [401, 401, 401, 429, 429]
        assert client.get("/v1/tasks", headers=bearer(ADMIN)).status_code == 200


@pytest.mark.parametrize(
    ("changes", "advice"),
    [
        ({"host": "0.0.0.0"}, "BUILDARENA_REQUIRE_KEYS=true"),
        ({"require_keys": True}, "BUILDARENA_ADMIN_KEY"),
    ],
)
def test_an_open_service_stays_on_loopback(changes, advice) -> None:
    with pytest.raises(ValueError, match=advice):
        check_binding(Settings().model_copy(update=changes))
    check_binding(Settings())


def test_the_key_of_the_metrics_opens_them_alone(context) -> None:
    secret = "a-key-for-prometheus-alone"
    changes = {**WITH_KEYS, "metrics_key": SecretStr(secret), "base_path": "/arena"}
    with changed(context, **changes) as own, api_client(own) as client:
        asked = {
            path: client.get(path, headers=bearer(secret)).status_code
            for path in ("/v1/metrics", "/arena/v1/metrics", "/v1/jobs", "/v1/keys", "/v1/tasks")
        }
        assert asked == {
            **dict.fromkeys(("/v1/metrics", "/arena/v1/metrics"), 200),
            **dict.fromkeys(("/v1/jobs", "/v1/keys", "/v1/tasks"), 401),
        }
        assert client.get("/v1/metrics", headers=bearer(secret + "x")).status_code == 401
        assert client.get("/v1/metrics").status_code == 401
        assert client.get("/v1/metrics", headers=bearer(ADMIN)).status_code == 200
        assert client.post("/v1/metrics", headers=bearer(secret)).status_code == 405
