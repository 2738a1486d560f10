"""Events as they are sent to all who listen."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC
from itertools import groupby
from typing import Any, Final

from sse_starlette import ServerSentEvent

from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.events import Event
from buildarena_backend.states import TURN

MAX_TURN_BYTES: Final = 64 << 10
"""A longer turn is sent without its actions and most of its text: the transcript has them."""
SHOWN: Final = 4000
"""Characters of its text that are sent then."""


def event_texts(transcripts: Transcripts, events: Sequence[Event]) -> list[bytes]:
    """The events' texts in their order; turns with all that was said and done.

    Args:
        transcripts: Where turns are read.
        events: In order.
    """
    turns: dict[int, dict[str, Any]] = {}
    spoken = [event for event in events if event.kind == TURN and event.job_id is not None]
    spoken.sort(key=_job_of)
    for job_id, taken in groupby(spoken, key=_job_of):
        turns |= transcripts.taken(job_id, list(taken))
    return [_text(event, turns.get(event.id)) for event in events]


def _job_of(event: Event) -> str:
    return event.job_id or ""


def _text(event: Event, turn: Mapping[str, Any] | None) -> bytes:
    data = {
        "job_id": event.job_id,
        "sweep_id": event.sweep_id,
        "at": event.at.astimezone(UTC).isoformat().replace("+00:00", "Z"),
        **({"turn": _bounded(turn)} if turn is not None else event.data),
    }
    return ServerSentEvent(json.dumps(data), event=event.kind, id=str(event.id)).encode()


def _bounded(turn: Mapping[str, Any]) -> dict[str, Any]:
    whole = {**turn, "shortened": False}
    if len(json.dumps(whole)) <= MAX_TURN_BYTES:
        return whole
    return {**turn, "text": turn["text"][:SHOWN], "actions": [], "shortened": True}
