"""Sessions under way: their turns as events, their transcript and their replay."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import httpx
import pytest
from support.jobs import claim, execute, journal_entry
from support.servers.live_api import live_api
from support.stages import work

from buildarena_pipeline.turns import Transcripts
from buildarena_store import StaleLeaseError, TurnResult, Usage
from buildarena_store.events import record_jobs
from buildarena_worker.session.turn_keeper import TurnKeeper

START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}


def submitted(api, **more: object) -> str:
    body = {"task": "support-1", "model": "builtin/expert", "simulator": "mujoco", **more}
    return api.post("/v1/jobs", json=body).json()["id"]


def opened(api) -> str:
    body = {"task": "support-1", "agent": "me", "seed": 1, "simulator": "mujoco"}
    return api.post("/v1/sessions", json=body).json()["id"]


def act(api, session: str, tool: str, arguments: object) -> None:
    body = {"tool": tool, "arguments": arguments}
    assert api.post(f"/v1/sessions/{session}/calls", json=body).status_code == 200


def claimed(context):
    """A lease that nobody needs to renew, however slow the machine is."""
    lease = claim(context)
    execute(context, "UPDATE leases SET expires_at = now() + interval '1 hour'")
    return lease


def take(context, lease, sequence: int, *calls: tuple[str, object], said: str = "") -> None:
    """Journals a reply and what came of it, as a worker does."""
    reply = {"text": said, "calls": [["c", *one] for one in calls], "finish": "stop"}
    usage = Usage(requests=1, input_tokens=5)
    context.store.journal.append(lease, journal_entry(sequence, reply=reply, usage=usage))
    results = [(True, None, "done") for _ in calls]
    context.store.turns.append(
        lease, TurnResult(index=sequence, sequence=sequence, sub_structure=None, results=results)
    )


class Stream:
    """The events of a job, read in a thread."""

    def __init__(self, url: str, job: str, last_id: int = 0) -> None:
        self.events: list[tuple[int, str, dict]] = []
        self._client = httpx.Client(timeout=30)
        self._url = f"{url}/v1/jobs/{job}/events"
        self._headers = {"Last-Event-ID": str(last_id)}
        self._closing = False
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        found: dict[str, str] = {}
        try:
            with self._client.stream("GET", self._url, headers=self._headers) as answer:
                for line in answer.iter_lines():
                    name, _, value = line.partition(": ")
                    if self._closing:
                        return
                    if line:
                        found[name] = value
                    elif "data" in found:
                        data = json.loads(found["data"])
                        self.events.append((int(found["id"]), found["event"], data))
                        found = {}
        except httpx.HTTPError:
            return

    def turns(self) -> list[int]:
        return [data["turn"]["index"] for _, kind, data in self.events if kind == "turn"]

    def wait_for(self, turns: int, within_s: float = 20.0) -> None:
        end = time.monotonic() + within_s
        while len(self.turns()) < turns:
            assert time.monotonic() < end, self.turns()
            time.sleep(0.02)


@contextmanager
def streaming(context, url: str, job: str, last_id: int = 0) -> Iterator[Stream]:
    stream = Stream(url, job, last_id)
    try:
        yield stream
    finally:
        stream._closing = True
        # A last event lets its thread see that it shall end.
        with context.store.database.transaction() as connection:
            record_jobs(connection, [job], "queued", {})
        stream._thread.join()
        stream._client.close()


@pytest.mark.ci
def test_turns_come_soon_and_once_over_reconnects_and_restarts(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    seen: list[int] = []
    with live_api(context) as url:
        with streaming(context, url, job) as first:
            take(context, lease, 0, ("start", START), said="I start.")
            first.wait_for(1)
            began = time.monotonic()
            take(context, lease, 1, ("attach_block_to", ATTACH))
            first.wait_for(2)
            # Half a second, and what a busy machine adds.
            assert time.monotonic() - began < 8
            turn = next(data for _, kind, data in first.events if kind == "turn")["turn"]
            assert (turn["text"], turn["role"], turn["stage"]) == ("I start.", "builder", "build")
            assert turn["actions"][0]["name"] == "start"
            assert turn["actions"][0]["arguments"] == START
            last_id = max(id_ for id_, kind, _ in first.events if kind == "turn")
            seen += first.turns()
        for sequence in (2, 3):
            take(context, lease, sequence)
        with streaming(context, url, job, last_id) as second:
            second.wait_for(2)
            seen += second.turns()
            last_id = max(id_ for id_, kind, _ in second.events if kind == "turn")
    take(context, lease, 4)
    with live_api(context) as url, streaming(context, url, job, last_id) as third:
        take(context, lease, 5)
        third.wait_for(2)
        seen += third.turns()
    assert seen == [0, 1, 2, 3, 4, 5]


def test_a_sweeps_stream_has_no_turns(api, context, sweep) -> None:
    sweep_id = api.post("/v1/sweeps", json=sweep).json()["id"]
    lease = claimed(context)
    take(context, lease, 0)
    kinds = [event.kind for event in context.store.events.after(0, sweep_id=sweep_id)]
    assert "running" in kinds
    assert "turn" not in kinds
    of_job = [event.kind for event in context.store.events.after(0, job_id=lease.job.id)]
    assert of_job[-1] == "turn"


def test_a_very_long_turn_is_sent_in_short(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    take(context, lease, 0, said="x" * 200_000)
    with live_api(context) as url, streaming(context, url, job) as stream:
        stream.wait_for(1)
        turn = next(data["turn"] for _, kind, data in stream.events if kind == "turn")
    assert turn["shortened"]
    assert 0 < len(turn["text"]) < 10_000
    whole = api.get(f"/v1/jobs/{job}/transcript").json()["turns"][0]
    assert len(whole["text"]) == 200_000


def test_the_transcript_of_a_session_under_way_is_the_one_it_will_have(api, context) -> None:
    job = submitted(api)
    assert api.get(f"/v1/jobs/{job}/transcript").status_code == 404
    work(context, steps=1)
    assert context.store.jobs.get(job).state == "queued"
    live = api.get(f"/v1/jobs/{job}/transcript")
    kept = context.artifacts.get(context.store.jobs.artifacts(job)["transcript"])
    assert live.content == kept
    work(context)
    ended = api.get(f"/v1/jobs/{job}/transcript")
    assert ended.content == kept
    assert "turns, " in api.get(f"/v1/jobs/{job}/transcript", params={"style": "markdown"}).text


def test_a_session_that_is_resumed_takes_no_turn_twice(api, context) -> None:
    job = submitted(api, task="transport-1")
    work(context, steps=1)
    count = context.store.turns.count(job)
    assert count > 10
    # Three trials: the session is run again from its start after each.
    work(context)
    indices = [record.index for record in context.store.turns.read(job)]
    assert indices == list(range(len(indices)))
    assert len(indices) > count
    kept = api.get(f"/v1/jobs/{job}/transcript").json()["turns"]
    assert len(kept) == len(indices)


@pytest.mark.ci
def test_a_turn_that_was_journalled_and_not_told_is_told_when_the_session_resumes(
    api, context, monkeypatch
) -> None:
    job = submitted(api)
    told = TurnKeeper.__call__

    def breaks_off(self, turn, entry) -> None:
        if turn.index == 5:
            raise ConnectionError("the worker dies here")
        told(self, turn, entry)

    monkeypatch.setattr(TurnKeeper, "__call__", breaks_off)
    work(context, steps=1)
    assert context.store.turns.count(job) == 5
    assert len(context.store.journal.read(job)) == 6
    monkeypatch.undo()
    execute(context, "UPDATE jobs SET available_at = now() - interval '1 hour'")
    work(context, steps=1)
    indices = [record.index for record in context.store.turns.read(job)]
    assert indices == list(range(len(indices)))
    assert len(indices) > 6


def test_a_worker_without_a_lease_tells_nothing(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    take(context, lease, 0)
    stale = replace(lease, token=lease.token + 1)
    context.store.turns.append(
        stale, TurnResult(index=1, sequence=1, sub_structure=None, results=[])
    )
    assert context.store.turns.count(job) == 1
    with pytest.raises(StaleLeaseError):
        take(context, stale, 1)


def test_texts_that_no_database_takes_are_kept_readable(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    take(context, lease, 0)
    result = (False, "malformed_arguments", "not \0 and \ud800")
    reply = {"text": "", "calls": [["c", "x", {}]], "finish": "stop"}
    context.store.journal.append(lease, journal_entry(1, reply=reply))
    turn = TurnResult(index=1, sequence=1, sub_structure="a\0b", results=[result])
    context.store.turns.append(lease, turn)
    shown = api.get(f"/v1/jobs/{job}/transcript").json()["turns"][1]
    assert shown["sub_structure"] == "a\ufffdb"
    assert shown["actions"][0]["feedback"].startswith("not \ufffd")


def test_replays_grow_with_a_models_session(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    take(context, lease, 0, ("start", START))
    take(context, lease, 1, ("attach_block_to", ATTACH))
    first = api.get(f"/v1/jobs/{job}/replay").json()
    assert first["exact"] is None
    assert [step["turn"] for step in first["chapters"][0]["steps"]] == [0, 1]
    take(context, lease, 2, ("attach_block_to", {**ATTACH, "face": "B"}))
    again = api.get(f"/v1/jobs/{job}/replay").json()
    assert [step["added"][0]["id"] for step in again["chapters"][0]["steps"]] == ["1", "2", "3"]


def test_an_agents_calls_are_turns_too(api, context) -> None:
    job = opened(api)
    act(api, job, "start", START)
    act(api, job, "attach_block_to", ATTACH)
    events = [one for one in context.store.events.after(0, job_id=job) if one.kind == "turn"]
    turns = Transcripts(context.store, context.artifacts).taken(job, events[1:])
    (turn,) = turns.values()
    assert (turn["index"], turn["actions"][0]["name"]) == (1, "attach_block_to")
    shown = api.get(f"/v1/jobs/{job}/transcript").json()["turns"]
    assert [one["index"] for one in shown] == [0, 1]
    assert shown[1] == json.loads(json.dumps(turn))


def test_a_cancelled_session_leaves_its_transcript(api, context) -> None:
    job = submitted(api)
    lease = claimed(context)
    take(context, lease, 0, ("start", START))
    assert api.post(f"/v1/jobs/{job}/cancel").status_code == 200
    assert len(api.get(f"/v1/jobs/{job}/transcript").json()["turns"]) == 1
    assert len(api.get(f"/v1/jobs/{job}/replay").json()["chapters"]) == 1
