"""The event hub: the source of progress streams.

Listeners to the same sweep or job share its reads and each event's text.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC
from functools import partial
from typing import Any, Final, TypeVar

import structlog
from anyio import CapacityLimiter, to_thread
from sqlalchemy.exc import SQLAlchemyError
from sse_starlette import ServerSentEvent

from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.events import Event
from buildarena_backend.process.context import Context
from buildarena_backend.states import TURN

log = structlog.get_logger(__name__)

POLL_S = 0.5
KEYS_EVERY_S = 2.0
"""Time for which a stream may outlive the key that opened it."""
PAGE = 1000
JOB_PAGE = 50
"""Events of a job that are read at once: those that are turns may be long."""
AT_ONCE: Final = 3
"""Threads that read."""


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Piece:
    """Events as they are sent, in order, by their ids.

    Attributes:
        floor: No further event with this id or a smaller one appears.
        more: Whether there are further events already.
    """

    texts: Mapping[int, bytes]
    floor: int
    more: bool


class EventHub:
    """Reads events while there are listeners.

    Args:
        context: Connections that ordinary requests do not take all of.
    """

    def __init__(self, context: Context) -> None:
        self._store = context.store
        self._transcripts = Transcripts(self._store, context.artifacts)
        self._threads = CapacityLimiter(AT_ONCE)
        self._reading: dict[object, asyncio.Task[Any]] = {}

    async def require(self, id_: str, *, sweep: bool) -> None:
        """Check that the job or sweep exists.

        Raises:
            UnknownIdError: It does not exist.
        """
        find: Callable[[str], object] = self._store.sweeps.get if sweep else self._store.jobs.get
        await self._share((id_, "exists"), partial(find, id_))

    async def listen(
        self, id_: str, *, sweep: bool, last_id: int, key_id: str | None
    ) -> AsyncIterator[bytes]:
        """Yield events after an id: first past ones, then new ones as they happen.

        Args:
            id_: Id of the job, or of the sweep with its jobs.
            last_id: Only events with greater ids.
            key_id: The key that listens; the stream ends when it becomes invalid.
        """
        floor, sent = last_id, set[int]()
        while True:
            read = partial(self._read, id_, floor, sweep=sweep)
            try:
                if key_id is not None and await self._has_ended(key_id):
                    return
                piece = await self._share((id_, floor), read)
            except SQLAlchemyError as error:
                log.warning("events_unreadable", error=str(error).splitlines()[0])
                await asyncio.sleep(POLL_S)
                continue
            if fresh := [text for event, text in piece.texts.items() if event not in sent]:
                yield b"".join(fresh)
            floor = max(floor, piece.floor)
            sent = {event for event in sent.union(piece.texts) if event > floor}
            if not piece.more:
                await asyncio.sleep(POLL_S)

    async def _has_ended(self, key_id: str) -> bool:
        ask = partial(self._store.keys.ended, [key_id])
        return bool(await self._share((key_id, "ended"), ask, keep_s=KEYS_EVERY_S))

    def _read(self, id_: str, floor: int, *, sweep: bool) -> Piece:
        """Return the events after a settled one: a page, or all that are not settled."""
        about, limit = {"sweep_id" if sweep else "job_id": id_}, PAGE if sweep else JOB_PAGE
        settled = self._store.events.settled()
        events = page = self._store.events.after(floor, limit=limit, **about)
        while len(page) == limit and page[-1].id > settled:
            page = self._store.events.after(page[-1].id, limit=limit, **about)
            events = events + page
        texts = event_texts(self._transcripts, events)
        more = len(page) == limit
        return Piece(
            texts={event.id: text for event, text in zip(events, texts, strict=True)},
            floor=page[-1].id if more else settled,
            more=more,
        )

    async def _share(self, name: object, read: Callable[[], T], *, keep_s: float = POLL_S) -> T:
        """Return a thread's result, shared by callers within a short time."""
        reading = self._reading.get(name)
        if reading is None:
            limited = to_thread.run_sync(read, limiter=self._threads)
            reading = self._reading[name] = asyncio.ensure_future(limited)
            asyncio.get_running_loop().call_later(keep_s, self._reading.pop, name)
        result: T = await asyncio.shield(reading)
        return result


MAX_TURN_BYTES: Final = 64 << 10
"""A longer turn is sent without its actions and most of its text: the transcript has them."""
SHOWN: Final = 4000
"""Characters of its text that are sent then."""


def event_texts(transcripts: Transcripts, events: Sequence[Event]) -> list[bytes]:
    """Return the events' texts in their order; turns with all texts and actions.

    Args:
        events: In order.
    """
    turns: dict[int, dict[str, Any]] = {}
    spoken: dict[str, list[Event]] = {}
    for event in events:
        if event.kind == TURN and event.job_id is not None:
            spoken.setdefault(event.job_id, []).append(event)
    for job_id, job_events in spoken.items():
        turns |= transcripts.turns_of(job_id, job_events)
    return [_text(event, turns.get(event.id)) for event in events]


def _text(event: Event, turn: Mapping[str, Any] | None) -> bytes:
    data = {
        "job_id": event.job_id,
        "sweep_id": event.sweep_id,
        "at": event.at.astimezone(UTC).isoformat().replace("+00:00", "Z"),
        **({"turn": _shorten(turn)} if turn is not None else event.data),
    }
    return ServerSentEvent(json.dumps(data), event=event.kind, id=str(event.id)).encode()


def _shorten(turn: Mapping[str, Any]) -> dict[str, Any]:
    complete = {**turn, "shortened": False}
    if len(json.dumps(complete)) <= MAX_TURN_BYTES:
        return complete
    return {**turn, "text": turn["text"][:SHOWN], "actions": [], "shortened": True}
