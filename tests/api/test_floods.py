"""One caller cannot take the API down: bounds per key, through real HTTP with two keys."""

import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import httpx
import pytest
from sqlalchemy import text
from support.jobs import end_all, execute
from support.servers.live_api import live_api
from support.servers.stacks import wait_until

from buildarena_backend.agents import sessions as agent_sessions
from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.errors import RefusedError
from buildarena_backend.results import verifications
from buildarena_backend.states import Verdict

START = {"tool": "start", "arguments": {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}}


@pytest.fixture
def as_key(guarded_url, context):
    with ExitStack() as stack:

        def make() -> httpx.Client:
            key, secret = context.store.keys.create(name="somebody", scopes=["submit"])
            headers = {"Authorization": f"Bearer {secret}"}
            client = httpx.Client(base_url=guarded_url, headers=headers, timeout=20)
            client.key_id = key.id
            return stack.enter_context(client)

        yield make


@pytest.fixture
def sweep_id(submissions) -> str:
    return submissions.submit_sweep(
        SweepSpec(tasks=["support-1"], models=["builtin/idle"], samples=20)
    ).sweep.id


@pytest.mark.ci
def test_streams_are_bounded_per_key_and_share_what_they_read(as_key, sweep_id) -> None:
    greedy, other = as_key(), as_key()
    path = f"/v1/sweeps/{sweep_id}/events"
    with ExitStack() as open_streams:
        answers = [open_streams.enter_context(greedy.stream("GET", path)) for _ in range(40)]
        assert [answer.status_code for answer in answers] == [200] * 32 + [429] * 8
        assert int(answers[-1].headers["retry-after"]) >= 1
        first = [line for line in read_lines(answers[0], 21 * 4) if line.startswith("id")]
        last = [line for line in read_lines(answers[31], 21 * 4) if line.startswith("id")]
        assert first == last
        with other.stream("GET", path) as mine:
            assert mine.status_code == 200
        assert other.get("/v1/jobs").status_code == 200

    # Streams that ended leave room.
    def opened() -> bool:
        with other.stream("GET", path) as again, greedy.stream("GET", path) as mine:
            return again.status_code == mine.status_code == 200

    wait_until(opened, 15, "ended streams leave room")


def read_lines(answer: httpx.Response, count: int) -> list[str]:
    lines = answer.iter_lines()
    return [next(lines) for _ in range(count)]


def test_the_stream_of_a_key_that_ended_ends(as_key, context, sweep_id) -> None:
    gone, staying_key = {"revoked_at": as_key(), "expires_at": as_key()}, as_key()
    path = f"/v1/sweeps/{sweep_id}/events"

    def read_to_the_end(client: httpx.Client) -> None:
        with client.stream("GET", path) as answer:
            for _ in answer.iter_lines():
                pass

    with ThreadPoolExecutor(2) as threads, staying_key.stream("GET", path) as staying:
        reading = [threads.submit(read_to_the_end, client) for client in gone.values()]
        assert read_lines(staying, 4)
        time.sleep(0.3)
        assert not any(one.done() for one in reading)
        for (ending, client), one in zip(gone.items(), reading, strict=True):
            ends = f"UPDATE api_keys SET {ending} = now() WHERE id = :id"
            execute(context, ends, {"id": client.key_id})
            one.result(8)
        assert staying.status_code == 200
        # An answer about a key is used again for half a second.
        for client in gone.values():
            wait_until(lambda c=client: c.get("/v1/jobs").status_code == 401, 5, "it is refused")


@pytest.mark.parametrize(
    ("what", "requests"), [("/results", 7), pytest.param("", 40, marks=pytest.mark.ci)]
)
def test_a_callers_requests_take_nobody_elses_place(
    as_key, sweep_id, context, what, requests
) -> None:
    greedy, other = as_key(), as_key()
    path = f"/v1/sweeps/{sweep_id}{what}"
    for client in (greedy, other):
        client.get("/v1/tasks")
    with context.store.database.transaction() as locking, ThreadPoolExecutor(40) as threads:
        locking.execute(text("LOCK TABLE sweeps IN ACCESS EXCLUSIVE MODE"))
        asked = [threads.submit(greedy.get, path) for _ in range(requests)]
        time.sleep(0.5)
        assert not any(one.done() for one in asked)
        assert other.get("/v1/jobs").status_code == 200
        locking.rollback()
        assert {one.result().status_code for one in asked} == {200}


def test_equal_verifications_are_one_and_are_bounded(
    as_key, context, sweep_id, monkeypatch
) -> None:
    monkeypatch.setattr(verifications, "MAX_OPEN", 3)
    greedy, other, third = as_key(), as_key(), as_key()
    end_all(context)
    ids = [job.id for job in context.store.jobs.page(limit=20, sweep_id=sweep_id)]
    with ThreadPoolExecutor(8) as threads:
        same = list(threads.map(lambda _: greedy.post(f"/v1/jobs/{ids[0]}/verify"), range(8)))
        rest = list(threads.map(lambda id_: greedy.post(f"/v1/jobs/{id_}/verify"), ids[1:8]))
    assert sorted(answer.status_code for answer in same) == [200] * 7 + [201]
    assert len({answer.json()["id"] for answer in same}) == 1
    assert sorted(answer.status_code for answer in rest) == [201] * 2 + [429] * 5
    # Another's equal request is the same verification; its own has room.
    assert other.post(f"/v1/jobs/{ids[0]}/verify").json()["id"] == same[0].json()["id"]
    own = [other.post(f"/v1/jobs/{id_}/verify") for id_ in ids[9:12]]
    assert {answer.status_code for answer in own} == {201}
    # One that ended leaves room, and the same job can be verified again.
    context.store.verifications.finish(own[0].json()["id"], {}, verdict=Verdict.VERIFIED)
    again = [other.post(f"/v1/jobs/{id_}/verify").status_code for id_ in (ids[9], ids[12])]
    assert again == [201, 429]
    # An audit takes the room that there is, and names the rest.
    accepted = third.post("/v1/leaderboard/verify", json={"model": "builtin/idle"}).json()
    assert len(accepted["verification_ids"]) + len(accepted["skipped_job_ids"]) == 20
    assert third.post(f"/v1/jobs/{accepted['skipped_job_ids'][0]}/verify").status_code == 429


def test_a_busy_database_pool_is_503(context, monkeypatch) -> None:
    engine = context.store.database.engine
    with live_api(context) as url, httpx.Client(base_url=url, timeout=20) as client:
        assert client.get("/v1/sweeps").status_code == 200
        monkeypatch.setattr(engine.pool, "_timeout", 0.2)
        with ExitStack() as taken:
            for _ in range(engine.pool.size() + engine.pool._max_overflow):
                taken.enter_context(engine.connect())
            answer = client.get("/v1/sweeps")
            assert answer.status_code == 503
            assert int(answer.headers["retry-after"]) >= 1
            # Key checks and streams have connections of their own.
            assert client.get("/v1/models").status_code == 200
        assert client.get("/v1/sweeps").status_code == 200


def test_a_restart_of_the_database_is_503_before_and_after_a_body(as_key, context) -> None:
    """A key is checked before a body is read: whoever checks it meets the lost connection first."""
    for method, body in (
        ("GET", None),
        ("POST", {"tasks": ["lift-1"], "models": ["builtin/idle"]}),
    ):
        assert as_key().request(method, "/v1/sweeps", json=body).is_success
        stranger = as_key()
        execute(
            context,
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
            "WHERE datname = current_database() AND pid <> pg_backend_pid()",
        )
        answers = [stranger.request(method, "/v1/sweeps", json=body) for _ in range(5)]
        lost = [answer for answer in answers if not answer.is_success]
        assert {answer.status_code for answer in lost} == {503}
        assert all(int(answer.headers["retry-after"]) >= 1 for answer in lost)
        assert answers[-1].is_success


def test_a_session_and_its_calls_have_a_size(as_key, context, monkeypatch) -> None:
    client = as_key()
    id_ = client.post("/v1/sessions", json={"task": "support-1", "agent": "me"}).json()["id"]
    calls = f"/v1/sessions/{id_}/calls"
    assert client.post(calls, json=START).status_code == 200
    large = client.post(calls, json={"tool": "start", "arguments": {"note": "x" * 65_536}})
    assert (large.status_code, large.json()["errors"][0]["field"]) == (422, "arguments")
    assert context.store.jobs.get(id_).actions == 1
    monkeypatch.setattr(agent_sessions, "MAX_SESSION_BYTES", 150_000)
    call = {"tool": "get_machine_summary", "arguments": {"note": "x" * 60_000}}
    answers = [client.post(calls, json=call) for _ in range(5)]
    assert [answer.status_code for answer in answers] == [200, 200, 200, 409, 409]
    assert "submit it" in answers[-1].json()["detail"]
    # Another process, which has to build the machine again, counts the same.
    other = agent_sessions.ExternalSessions(context)
    with pytest.raises(RefusedError, match="of 150,000"):
        other.call(id_, machine="main", tool="start", arguments={})
    assert client.post(f"/v1/sessions/{id_}/submit").status_code == 200
