"""Sessions under way and ended: turns as events, transcripts, and the search through them."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from support.jobs import claim, execute, finish, journal_entry
from support.servers.live_api import live_api
from support.stages import work

from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.journal import turns as kept_turns
from buildarena_backend.journal.journal import Usage
from buildarena_backend.journal.turns import TurnResult
from buildarena_backend.leases.leases import Lease
from buildarena_worker.construct import TurnKeeper

START = {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0], "note": ""}
ATTACH = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block", "note": ""}
SPEC = {"tasks": ["support-1"], "models": ["builtin/idle", "builtin/random"], "seeds": [0, 1]}
SAID = "I will attach two powered wheels below the beam, so that it can drive."
ANSWERED = "Refused: block 7 would overlap block 3."
TOLD = {"system": "You are the drafter. Draw gearboxes.", "user": ["Lift a weight.", "Again."]}


@pytest.fixture
def lease(context, submit_job) -> Lease:
    """That of the only job, which nobody needs to renew however slow the machine is."""
    submit_job()
    lease = claim(context)
    execute(context, "UPDATE leases SET expires_at = now() + interval '1 hour'")
    return lease


def take(
    context,
    lease: Lease,
    index: int,
    *calls: tuple[str, object],
    said: str = "",
    answered: str | None = None,
    **more: object,
) -> None:
    """Journals a reply and what came of it, as a worker does; its sequence is odd."""
    sequence = 2 * index + 1
    made = calls or ([("attach", {})] if answered else [])
    reply = {"text": said, "calls": [["c", *one] for one in made], "finish": "stop"}
    usage = Usage(requests=1, input_tokens=5)
    context.store.journal.append(lease, journal_entry(sequence, reply=reply, usage=usage, **more))
    result = (False, "overlap", answered) if answered else (True, None, "done")
    results = [result for _ in made]
    turn = TurnResult(index=index, sequence=sequence, sub_structure=None, results=results)
    context.store.turns.append(lease, turn)


@contextmanager
def turns(url: str, job: str, last_id: int = 0) -> Iterator[Iterator[tuple[int, dict]]]:
    """The turns of a job's stream, each with its event's id."""

    def read(lines: Iterator[str]) -> Iterator[tuple[int, dict]]:
        found: dict[str, str] = {}
        for line in lines:
            name, _, value = line.partition(": ")
            found = {**found, name: value} if line else {}
            if name == "data" and found["event"] == "turn":
                yield int(found["id"]), json.loads(value)["turn"]

    path, headers = f"{url}/v1/jobs/{job}/events", {"Last-Event-ID": str(last_id)}
    with httpx.stream("GET", path, headers=headers, timeout=30) as answer:
        yield read(answer.iter_lines())


def test_turns_come_soon_and_once_over_reconnects_and_restarts(context, lease) -> None:
    job = lease.job.id
    with live_api(context) as url:
        with turns(url, job) as told:
            take(context, lease, 0, ("start", START), said="I start.")
            _, turn = next(told)
            assert (turn["text"], turn["role"], turn["stage"]) == ("I start.", "builder", "build")
            (action,) = turn["actions"]
            assert (action["name"], action["arguments"]) == ("start", START)
            began = time.monotonic()
            take(context, lease, 1, ("attach_block_to", ATTACH))
            last, turn = next(told)
            # Half a second, and what a busy machine adds.
            assert time.monotonic() - began < 8
        seen = [0, turn["index"]]
        take(context, lease, 2)
        with turns(url, job, last) as told:
            last, turn = next(told)
            seen.append(turn["index"])
    with live_api(context) as url, turns(url, job, last) as told:
        take(context, lease, 3, said="x" * 200_000)
        last, turn = next(told)
    # A very long one is sent in short.
    assert turn["shortened"]
    assert 0 < len(turn["text"]) < 10_000
    assert [*seen, turn["index"]] == [0, 1, 2, 3]
    with live_api(context) as url:
        whole = httpx.get(f"{url}/v1/jobs/{job}/transcript").json()["turns"][3]
    assert len(whole["text"]) == 200_000


def test_a_sweeps_stream_has_no_turns(api, context, sweep) -> None:
    sweep_id = api.post("/v1/sweeps", json=sweep).json()["id"]
    lease = claim(context)
    take(context, lease, 0)
    kinds = [event.kind for event in context.store.events.after(0, sweep_id=sweep_id)]
    assert "running" in kinds
    assert "turn" not in kinds
    of_job = [event.kind for event in context.store.events.after(0, job_id=lease.job.id)]
    assert of_job[-1] == "turn"


def test_the_transcript_of_an_open_session_is_the_one_it_will_have(
    api, context, submit_job
) -> None:
    job = submit_job()
    path = f"/v1/jobs/{job}/transcript"
    assert api.get(path).status_code == 404
    work(context, steps=1)
    assert context.store.jobs.get(job).state == "queued"
    live = api.get(path)
    kept = context.artifacts.get(context.store.jobs.artifacts(job)["transcript"])
    assert live.content == kept
    work(context)
    assert api.get(path).content == kept
    assert "turns, " in api.get(path, params={"format": "markdown"}).text


@pytest.mark.ci
def test_a_turn_journalled_and_not_told_is_told_on_resuming(
    context, submit_job, monkeypatch
) -> None:
    job = submit_job()
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
    indices = [record["index"] for record in context.store.turns.read(job)]
    assert indices == list(range(len(indices)))
    assert len(indices) > 6


def test_a_cancelled_session_leaves_its_transcript_and_replay(api, context, lease) -> None:
    path = f"/v1/jobs/{lease.job.id}"
    take(context, lease, 0, ("start", START))
    take(context, lease, 1, ("attach_block_to", ATTACH))
    replay = api.get(f"{path}/replay").json()
    assert replay["exact"] is None
    assert [step["turn"] for step in replay["chapters"][0]["steps"]] == [0, 1]
    # Texts that no database takes are kept readable.
    reply = {"text": "", "calls": [["c", "x", {}]], "finish": "stop"}
    context.store.journal.append(lease, journal_entry(5, reply=reply))
    odd = [(False, "malformed_arguments", "not \0 and \ud800")]
    turn = TurnResult(index=2, sequence=5, sub_structure="a\0b", results=odd)
    context.store.turns.append(lease, turn)
    assert api.post(f"{path}/cancel").status_code == 200
    told = api.get(f"{path}/transcript").json()["turns"]
    assert [turn["index"] for turn in told] == [0, 1, 2]
    assert told[2]["sub_structure"] == "a\ufffdb"
    assert told[2]["actions"][0]["feedback"].startswith("not \ufffd")
    steps = api.get(f"{path}/replay").json()["chapters"][0]["steps"]
    assert [step["added"][0]["id"] for step in steps[:2]] == ["1", "2"]


def test_an_agents_calls_are_turns_and_are_found(api, context, open_session, act) -> None:
    job = open_session()
    act(job, "start", START)
    act(job, "remove_block", {"block": 7})
    events = [one for one in context.store.events.after(0, job_id=job) if one.kind == "turn"]
    (turn,) = Transcripts(context.store, context.artifacts).turns_of(job, events[1:]).values()
    assert (turn["index"], turn["actions"][0]["name"]) == (1, "remove_block")
    shown = api.get(f"/v1/jobs/{job}/transcript").json()["turns"]
    assert [one["index"] for one in shown] == [0, 1]
    assert shown[1] == json.loads(json.dumps(turn))
    words = turn["actions"][0]["feedback"].split()[:9]
    assert (job, 1) in {(m["job_id"], m["turn"]) for m in found(api, f'"{" ".join(words)}"')}


@pytest.fixture
def sweep_of_talkers(api, context) -> str:
    """Four jobs, two of which say and are answered something; one of them has ended."""
    sweep = api.post("/v1/sweeps", json=SPEC).json()["id"]
    first, second = claim(context), claim(context)
    take(context, first, 0, said="Nothing yet.", prompt_messages=TOLD)
    take(context, first, 1, said=SAID, answered=ANSWERED)
    take(context, first, 2, prompt_messages={"user": ["Draw the gearbox again."]})
    said = "<b>Wheel</b> naïve 🚗, a gearbox and a kitchen sink"
    take(context, second, 0, said=said, prompt_messages={"user": ["Build a bridge."]})
    finish(context, second)
    return sweep


def found(api, words: str, **more: object) -> list[dict]:
    answer = api.get("/v1/transcripts", params={"text": words, **more})
    assert answer.status_code == 200, answer.text
    return answer.json()["data"]


def marked(match: dict) -> list[str]:
    return [piece["text"] for piece in match["excerpt"] if piece["match"]]


def test_words_are_found_in_all_their_forms_with_their_turns(api, sweep_of_talkers) -> None:
    both = {match["turn"]: match for match in found(api, "wheel")}
    assert {turn: match["where"] for turn, match in both.items()} == {0: "reply", 1: "reply"}
    assert "".join(piece["text"] for piece in both[1]["excerpt"]) == SAID
    assert marked(both[1]) == ["wheels"]
    transcript = api.get(f"/v1/jobs/{both[1]['job_id']}/transcript").json()
    assert transcript["turns"][1]["text"] == SAID
    assert (both[0]["outcome"], both[0]["task"]) == ("success", "support-1")
    assert "naïve 🚗" in "".join(piece["text"] for piece in both[0]["excerpt"])
    # What models are answered is searched too.
    (match,) = found(api, '"overlap block 3"')
    assert (match["turn"], match["where"]) == (1, "feedback")
    assert "overlap" in marked(match)
    assert found(api, '"block 3 overlap"') == []
    assert [match["turn"] for match in found(api, "overlaps or kitchens")] == [0, 1]
    assert [match["turn"] for match in found(api, "wheel -kitchen")] == [1]
    # A search is of one task, model and sweep.
    model = both[1]["model"]
    (other,) = {"builtin/idle", "builtin/random"} - {model}
    where = {"model": model, "task": "support-1", "sweep": sweep_of_talkers}
    assert len(found(api, "powered", **where)) == 1
    assert found(api, "powered", model=other) == found(api, "powered", task="lift-1") == []
    for name, bad, status in (
        *(("task", "lift-9", 422), ("sweep", "sweep_0", 404)),
        *(("text", bad, 422) for bad in ("the", "  ", "!?", "\0", '""', "-wheel", "x" * 201)),
    ):
        answer = api.get("/v1/transcripts", params={"text": "powered", name: bad})
        assert answer.status_code == status, (name, bad)


def test_what_roles_were_told_is_kept(api, sweep_of_talkers) -> None:
    (match,) = found(api, '"overlap block 3"', sweep=sweep_of_talkers)
    kept = api.get(f"/v1/jobs/{match['job_id']}/prompts").json()["data"]
    again = {"turn": 2, "system": None, "user": ["Draw the gearbox again."]}
    assert kept == [{"turn": 0, **TOLD}, again]


def test_of_many_turns_some_are_searched_page_by_page(api, context, lease, monkeypatch) -> None:
    for index in range(6):
        take(context, lease, index, said=f"The beam, part {index}.")
    assert [match["turn"] for match in found(api, "beam")] == list(range(6))
    some = api.get("/v1/transcripts?text=beam&limit=4").json()
    rest = found(api, "beam", limit=4, cursor=some["next_cursor"])
    assert [match["turn"] for match in some["data"] + rest] == list(range(6))
    monkeypatch.setattr(kept_turns, "MAX_MATCHES", 3)
    assert len(found(api, "beam")) == 3
