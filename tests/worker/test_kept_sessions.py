"""Sessions that an earlier version played and kept are replayed to the last byte."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from support.documents.kept_sessions import (
    SCRIPTED,
    SESSIONS,
    described,
    digest_of,
    played_again,
    transcript_of,
)

from buildarena_store import JournalEntry, Usage


def entry(data: dict[str, Any]) -> JournalEntry:
    usage = {**data["usage"], "cost_usd": Decimal(data["usage"]["cost_usd"])}
    return JournalEntry(**{**data, "usage": Usage(**usage)})


@pytest.mark.parametrize("resumed", [False, True], ids=["verified", "resumed"])
@pytest.mark.parametrize("name", SESSIONS)
def test_a_kept_session_replays_to_the_same_bytes(play, name, resumed) -> None:
    kept = SESSIONS[name]
    entries = [entry(data) for data in kept["journal"]]
    # A resumed session has a model to ask, and asks it only for what the journal lacks.
    offline = not resumed
    cut = len(entries) // 2 if resumed and name != SCRIPTED else len(entries)
    played = played_again(play, kept, entries=entries[:cut], offline=offline)
    assert described(played.result) == kept["result"]
    assert [e.request_hash for e in played.entries[:cut]] == [e.request_hash for e in entries[:cut]]
    if resumed:
        # Those that kept them kept no prompts.
        assert [replace(entry, told=None) for entry in played.entries] == entries
    assert played.session.transcript.to_json() == transcript_of(kept)
    assert played.session.transcript.refusals == kept["refusals"]
    assert digest_of(played) == kept["machine"]


def test_the_kept_sessions_end_in_every_way() -> None:
    kinds = {kept["result"]["kind"] for kept in SESSIONS.values()}
    assert kinds == {"Finished", "Suspended", "Failed", "LimitReached"}
