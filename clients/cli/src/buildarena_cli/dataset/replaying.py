"""The actions of a session as rows, and what they build when they are done again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from typing import Any, Final

from buildarena_backend.replays.from_document import CONTROL, PROGRAMMED
from buildarena_backend.replays.from_turns import replay_of_turns
from buildarena_cli.dataset.messages import compact
from buildarena_geometry import DocumentError

SESSION: Final = "session"
"""The role whose turn carries out a controller's program."""

Turns = Sequence[Mapping[str, Any]]
Document = Mapping[str, Any]


def parts_hash(document: Document) -> str:
    """SHA-256 of a machine document without its logs, in one spelling."""
    return sha256(compact(_without_logs(document)).encode()).hexdigest()


def replayed_hash(turns: Turns, document: Document | None) -> str | None:
    """The `parts_hash` of what the actions of a session build; None when they build nothing.

    Args:
        turns: The transcript's.
        document: The machine that was kept, whose log has the program of a controller.
    """
    try:
        machine = replay_of_turns(turns).machine if turns else None
    except DocumentError:
        return None
    if machine is None or not machine.started:
        return None
    replayed = machine.copy()
    for name, arguments in _program(turns, document):
        replayed.act(name, arguments)
    return parts_hash(replayed.to_document())


def action_rows(job_id: str, turns: Turns, document: Document | None) -> list[dict[str, Any]]:
    """The actions of a job in their order, those of a controller's program last."""
    rows = [
        _row(job_id, turn, action, turn["role"]) for turn in turns for action in turn["actions"]
    ]
    for name, arguments in _program(turns, document):
        turn = {"index": None, "stage": CONTROL}
        action = {"name": name, "arguments": arguments, "ok": True, "reason": None}
        rows.append(_row(job_id, turn, action, SESSION))
    return [{**row, "index": index} for index, row in enumerate(rows)]


def _program(turns: Turns, document: Document | None) -> Iterator[tuple[str, Any]]:
    """The key presses that the session took from a controller's text, as actions."""
    if document is None or not any(turn["stage"] == CONTROL for turn in turns):
        return
    for record in document["log"]:
        if record["name"] in PROGRAMMED and record["reason"] is None:
            yield record["name"], record["arguments"]


def _row(
    job_id: str, turn: Mapping[str, Any], action: Mapping[str, Any], role: str
) -> dict[str, Any]:
    return {
        "job_id": job_id,
        "turn": turn["index"],
        "phase": turn["stage"],
        "sub_structure": turn.get("sub_structure"),
        "role": role,
        "tool": action["name"],
        "arguments": compact(action["arguments"]),
        "accepted": action["ok"],
        "refusal": None if action["ok"] else action["reason"] or "refused",
        "feedback": None if action["ok"] else action["feedback"],
    }


def _without_logs(document: Document) -> dict[str, Any]:
    parts = {name: value for name, value in document.items() if name != "log"}
    parts["available"] = {
        name: _without_logs(machine) for name, machine in document.get("available", {}).items()
    }
    return parts
