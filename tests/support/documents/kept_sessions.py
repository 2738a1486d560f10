"""Plays the kept sessions of tests/data/sessions.json again and writes what they read now.

Run it after an intended change of prompts, tools or answers: `make generate NAME=sessions`.
Built-in models are asked again; other replies are those that were kept.
"""

import json
from dataclasses import asdict
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

from support.player import Played, Player
from support.providers.scripted import Scripted

from buildarena_backend.journal.journal import JournalEntry
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_geometry.machine_files import machine_bytes
from buildarena_worker.session.messages import Completion, ToolCall
from buildarena_worker.session.results import Failed, Finished, Suspended

FILE = Path(__file__).parents[2] / "data/sessions.json"
SCRIPTED = "scripted-failures"
SESSIONS: dict[str, dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))
"""What was kept of each session, by its name."""


def transcript_of(kept: dict[str, Any]) -> bytes:
    """The transcript that was kept, in the form in which transcripts are stored."""
    text = json.dumps(kept["transcript"], ensure_ascii=False, separators=(",", ":"))
    return text.encode()


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
        case Failed(reason=reason, detail=detail):
            return {**kind, "reason": reason, "detail": detail}
    raise AssertionError(result)


def played_again(play: Any, kept: dict[str, Any], **more: Any) -> Played:
    """A kept session from its beginning; `play` and further options are those of `Player`."""
    named = {name: kept[name] for name in ("task", "seed", "workflow", "loop", "limits")}
    records = [rollout(data) for data in kept["rollouts"]]
    played: Played = play(kept["model"], **named, rollouts=records, test_trials=False, **more)
    return played


def digest_of(played: Played) -> str | None:
    """Of the machine that a session built."""
    machine = played.session.machine
    return None if machine is None else sha256(machine_bytes(machine)).hexdigest()


def completion(reply: dict[str, Any]) -> Completion:
    """A reply of a journal."""
    calls = tuple(ToolCall(id=id_, name=name, arguments=a) for id_, name, a in reply["calls"])
    return Completion(text=reply["text"], calls=calls, finish=reply["finish"])


def _kept(entry: JournalEntry) -> dict[str, Any]:
    """An entry without the messages to the role, which playing it again makes anew."""
    fields = json.loads(json.dumps(asdict(entry), default=str))
    return {name: value for name, value in fields.items() if name != "prompt_messages"}


def main() -> None:
    """Plays each from its beginning, and writes them."""
    for name, kept in SESSIONS.items():
        scripted = name == SCRIPTED
        client = Scripted(*(completion(e["reply"]) for e in kept["journal"])) if scripted else None
        played = played_again(Player(), kept, client=client)
        transcript = played.session.transcript
        SESSIONS[name] = kept | {
            "result": described(played.result),
            "machine": digest_of(played),
            "refusals": transcript.refusals,
            "journal": [_kept(entry) for entry in played.entries],
            "transcript": json.loads(transcript.to_json()),
        }
    FILE.write_text(json.dumps(SESSIONS, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
