"""Sessions that an earlier version played and kept are replayed to the last byte."""

from __future__ import annotations

import json
from datetime import datetime
from decimal import Decimal
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from buildarena_geometry.machine_files import machine_bytes
from buildarena_store import JournalEntry, RolloutRecord, Usage
from buildarena_worker.session.results import Failed, Finished, LimitReached, Suspended
from buildarena_worker.workflow.rounds import Loop

KEPT = Path(__file__).parents[1] / "data/sessions"
NAMES = sorted(path.stem for path in KEPT.glob("*.json") if not path.stem.endswith(".transcript"))


def entry(data: dict[str, Any]) -> JournalEntry:
    usage = {**data["usage"], "cost_usd": Decimal(data["usage"]["cost_usd"])}
    return JournalEntry(**{**data, "usage": Usage(**usage)})


def rollout(data: dict[str, Any]) -> RolloutRecord:
    times = {name: datetime.fromisoformat(data[name]) for name in ("created_at", "finished_at")}
    return RolloutRecord(**{**data, **times})


def described(result: object) -> dict[str, Any]:
    """A result in the form of the kept ones."""
    kind = {"kind": type(result).__name__}
    match result:
        case Finished(best=best):
            return {**kind, "best": best.number}
        case Suspended(number=number, final=final):
            return {**kind, "number": number, "final": final}
        case Failed(reason=reason, detail=detail) | LimitReached(limit=reason, detail=detail):
            return {**kind, "reason": reason, "detail": detail}
    raise AssertionError(result)


@pytest.mark.parametrize("resumed", [False, True], ids=["verified", "resumed"])
@pytest.mark.parametrize("name", NAMES)
def test_a_kept_session_replays_to_the_same_bytes(play, name, resumed) -> None:
    kept = json.loads((KEPT / f"{name}.json").read_text())
    entries = [entry(data) for data in kept["journal"]]
    # A resumed session has a model to ask, and asks it only for what the journal lacks.
    offline = not resumed
    cut = len(entries) // 2 if resumed and name != "scripted-failures" else len(entries)
    played = play(
        kept["model"],
        task=kept["task"],
        seed=kept["seed"],
        workflow=kept["workflow"],
        loop=Loop(**kept["loop"]),
        limits=kept["limits"],
        entries=entries[:cut],
        rollouts=[rollout(data) for data in kept["rollouts"]],
        offline=offline,
    )
    assert described(played.result) == kept["result"]
    assert [e.request_hash for e in played.entries[:cut]] == [e.request_hash for e in entries[:cut]]
    if resumed:
        assert played.entries == entries
    transcript = (KEPT / f"{name}.transcript.json").read_bytes()
    assert played.session.transcript.to_json() == transcript
    assert played.session.transcript.refusals == kept["refusals"]
    machine = played.session.machine
    digest = None if machine is None else sha256(machine_bytes(machine)).hexdigest()
    assert digest == kept["machine"]


def test_the_kept_sessions_end_in_every_way() -> None:
    kinds = {json.loads((KEPT / f"{name}.json").read_text())["result"]["kind"] for name in NAMES}
    assert kinds == {"Finished", "Suspended", "Failed", "LimitReached"}
