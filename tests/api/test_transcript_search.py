"""The search through all transcripts: by words, in what was said and in what it was answered."""

import pytest
from sqlalchemy import Text, bindparam, text
from support.jobs import claim, finish, journal_entry

from buildarena_store import Lease
from buildarena_store.jobs import transcript_search
from buildarena_store.jobs.turns import TurnResult

SPEC = {"tasks": ["support-1"], "models": ["builtin/idle", "builtin/random"], "seeds": [0, 1]}
SAID = "I will attach two powered wheels below the beam, so that it can drive."
ANSWERED = "Refused: block 7 would overlap block 3."


TOLD = {"system": "You are the drafter. Draw gearboxes.", "user": ["Lift a weight.", "Again."]}


def take(
    context, lease: Lease, index: int, said: str, answered: str | None = None, **more: object
) -> None:
    """A turn of a session: a reply in the journal, and what came of it; its sequence is odd."""
    sequence = 2 * index + 1
    calls = [] if answered is None else [["c", "attach", {}]]
    reply = {"text": said, "calls": calls, "finish": "stop"}
    context.store.journal.append(lease, journal_entry(sequence, reply=reply, **more))
    results = [] if answered is None else [(False, "overlap", answered)]
    context.store.turns.append(
        lease, TurnResult(index=index, sequence=sequence, sub_structure=None, results=results)
    )


@pytest.fixture
def sweep(api, context) -> str:
    """Four jobs, two of which say and are answered something; one of them has ended."""
    sweep = api.post("/v1/sweeps", json=SPEC).json()["id"]
    first, second = claim(context), claim(context)
    take(context, first, 0, "Nothing yet.")
    take(context, first, 1, SAID, ANSWERED)
    take(context, second, 0, "<b>Wheel</b> naïve 🚗 and a kitchen sink")
    finish(context, second)
    return sweep


def found(api, words: str, **more: object) -> dict:
    answer = api.get("/v1/transcripts", params={"text": words, **more})
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.mark.usefixtures("sweep")
def test_words_are_found_in_all_their_forms_with_their_turns(api) -> None:
    both = found(api, "wheel")
    assert both["complete"]
    assert sorted((match["turn"], match["where"]) for match in both["matches"]) == [
        (0, "reply"),
        (1, "reply"),
    ]
    match = next(match for match in both["matches"] if match["turn"] == 1)
    assert "".join(piece["text"] for piece in match["excerpt"]) == SAID
    assert [piece["text"] for piece in match["excerpt"] if piece["match"]] == ["wheels"]
    transcript = api.get(f"/v1/jobs/{match['job']}/transcript").json()
    assert transcript["turns"][match["turn"]]["text"] == SAID
    other = next(match for match in both["matches"] if match["turn"] == 0)
    assert (other["outcome"], other["task"]) == ("success", "support-1")
    assert "naïve 🚗 and a kitchen sink" in "".join(piece["text"] for piece in other["excerpt"])


@pytest.mark.usefixtures("sweep")
def test_what_models_are_answered_is_searched_too(api) -> None:
    (match,) = found(api, '"overlap block 3"')["matches"]
    assert (match["turn"], match["where"]) == (1, "feedback")
    assert {piece["text"] for piece in match["excerpt"] if piece["match"]} >= {"overlap"}
    assert found(api, '"block 3 overlap"')["matches"] == []
    assert [match["turn"] for match in found(api, "overlaps or kitchens")["matches"]] == [0, 1]
    assert [match["turn"] for match in found(api, "wheel -kitchen")["matches"]] == [1]


def test_a_search_is_of_one_task_model_and_sweep(api, sweep) -> None:
    model = found(api, "powered")["matches"][0]["model"]
    (other,) = {"builtin/idle", "builtin/random"} - {model}
    assert len(found(api, "powered", model=model, task="support-1", sweep=sweep)["matches"]) == 1
    assert found(api, "powered", model=other)["matches"] == []
    assert found(api, "powered", task="lift-1")["matches"] == []
    answer = api.get("/v1/transcripts", params={"text": "powered", "task": "lift-9"})
    assert answer.status_code == 422
    answer = api.get("/v1/transcripts", params={"text": "powered", "sweep": "sweep_0"})
    assert answer.status_code == 404


@pytest.mark.parametrize("words", ["the", "  ", "!?", "\0", '""', "-wheel", "x" * 201])
def test_what_has_no_word_is_refused(api, words) -> None:
    answer = api.get("/v1/transcripts", params={"text": words})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "text")


def test_an_agents_calls_are_searched(api) -> None:
    opened = api.post("/v1/sessions", json={"task": "support-1", "agent": "me", "seed": 5}).json()
    path = f"/v1/sessions/{opened['id']}/calls"
    for base in (7, 8):
        call = {"tool": "remove_block", "arguments": {"block": base}}
        assert api.post(path, json=call).status_code == 200
    transcript = api.get(f"/v1/jobs/{opened['id']}/transcript").json()
    turns = [turn for turn in transcript["turns"] if turn["actions"]]
    words = turns[-1]["actions"][0]["feedback"].split()[:9]
    matches = found(api, f'"{" ".join(words)}"')["matches"]
    assert (opened["id"], turns[-1]["index"]) in {(m["job"], m["turn"]) for m in matches}


def test_of_very_many_turns_some_are_searched_and_it_says_so(api, context, monkeypatch) -> None:
    api.post("/v1/sweeps", json=SPEC)
    lease = claim(context)
    for index in range(6):
        take(context, lease, index, f"The beam, part {index}.")
    assert [match["turn"] for match in found(api, "beam")["matches"]] == list(range(6))
    some = found(api, "beam", limit=4)
    assert (len(some["matches"]), some["complete"]) == (4, False)
    monkeypatch.setattr(transcript_search, "MAX_MATCHES", 3)
    assert found(api, "beam")["complete"] is False


def plan_of(context, query: str) -> str:
    """How the database means to answer a search."""
    values = {"words": "wheel", "task": None, "model": None, "sweep": None}
    more = {"most": 10, "limit": 10, "options": ""}
    plan = text(f"EXPLAIN {query}").bindparams(*(bindparam(name, type_=Text()) for name in values))
    with context.store.database.transaction() as connection:
        connection.execute(text("SET LOCAL enable_seqscan = off"))
        return "\n".join(connection.execute(plan, {**values, **more}).scalars())


@pytest.mark.usefixtures("sweep")
def test_every_part_of_a_search_goes_by_an_index(context) -> None:
    shown = plan_of(context, transcript_search.SEARCH.text)
    for index in ("ix_journal_words", "ix_events_words", "ix_external_calls_words"):
        assert index in shown, shown
    assert "Seq Scan" not in shown


def test_what_roles_were_told_is_kept_and_found_once_a_job(api, context) -> None:
    sweep = api.post("/v1/sweeps", json=SPEC).json()["id"]
    first, second = claim(context), claim(context)
    take(context, first, 0, "Yes.", told=TOLD)
    take(context, first, 1, "Yes.")
    take(context, first, 2, "Yes.", told={"user": ["Draw the gearbox again."]})
    take(context, second, 0, "A gearbox?", told={"user": ["Build a bridge."]})
    (match,) = found(api, "gearbox", of="prompts")["matches"]
    assert (match["job"], match["turn"], match["where"]) == (first.job.id, 0, "prompt")
    assert [piece["text"] for piece in match["excerpt"] if piece["match"]] == ["gearboxes"]
    assert [m["turn"] for m in found(api, '"lift weights"', of="prompts")["matches"]] == []
    assert found(api, "gearbox")["matches"][0]["where"] == "reply"
    both = found(api, "bridge or gearbox", of="prompts", sweep=sweep)["matches"]
    assert {match["job"] for match in both} == {first.job.id, second.job.id}
    assert found(api, "gearbox", of="prompts", task="lift-1")["matches"] == []
    kept = api.get(f"/v1/jobs/{first.job.id}/prompts").json()["prompts"]
    assert kept == [
        {"turn": 0, **TOLD},
        {"turn": 2, "system": None, "user": ["Draw the gearbox again."]},
    ]
    assert api.get("/v1/jobs/job_0/prompts").status_code == 404


def test_a_search_of_prompts_goes_by_an_index(context) -> None:
    shown = plan_of(context, transcript_search.SEARCH_PROMPTS.text)
    assert "ix_journal_told" in shown, shown
    assert "Seq Scan on journal" not in shown
