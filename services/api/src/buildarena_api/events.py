"""The event hub: reads new events once for all who listen, and passes them on.

Who listens to the same sweep or job shares everything: which jobs are meant, what happened before,
and each event's text.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from itertools import groupby
from typing import Any, Final, TypeVar

import structlog
from anyio import CapacityLimiter, to_thread
from sqlalchemy.exc import SQLAlchemyError
from sse_starlette import ServerSentEvent

from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.events import SETTLED_AFTER, Event
from buildarena_backend.process.context import Context
from buildarena_backend.states import TURN

log = structlog.get_logger(__name__)

POLL_S = 0.5
KEYS_EVERY_S = 2.0
"""How long a stream may outlive the key that it was opened with."""
PAGE = 1000
JOB_PAGE = 50
"""Events of a job that are read at once: those that are turns may be long."""
AT_ONCE: Final = 3
"""Threads that read."""
BACKLOG = 10_000
"""Events kept for a slow listener; one that falls further behind is cut off and may come again."""


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Piece:
    """Some events as they are sent, and the ids of those they are."""

    ids: tuple[int, ...]
    text: bytes


@dataclass(slots=True, eq=False)
class _Listener:
    key_id: str | None
    ended: bool = False
    queue: asyncio.Queue[Piece | None] = field(
        default_factory=lambda: asyncio.Queue(maxsize=BACKLOG)
    )

    def put(self, piece: Piece) -> None:
        if self.queue.full():
            self.end()
        elif not self.ended:
            self.queue.put_nowait(piece)

    def end(self) -> None:
        self.ended = True
        while not self.queue.empty():
            self.queue.get_nowait()
        self.queue.put_nowait(None)


@dataclass(slots=True, eq=False)
class Channel:
    """A sweep or a job, with those who listen to it."""

    id: str
    is_sweep: bool
    job_ids: frozenset[str]
    listeners: set[_Listener] = field(default_factory=set)
    pages: dict[int, asyncio.Task[Piece]] = field(default_factory=dict)

    def wants(self, event: Event) -> bool:
        """Return whether an event concerns the subscription's job or sweep."""
        if event.kind == TURN and self.is_sweep:
            return False
        return event.job_id in self.job_ids or (self.is_sweep and event.sweep_id == self.id)


class EventHub:
    """Polls the events table while anybody listens.

    Args:
        context: Connections that ordinary requests do not take all of.
    """

    def __init__(self, context: Context) -> None:
        self._store = context.store
        self._transcripts = Transcripts(self._store, context.artifacts)
        self._threads = CapacityLimiter(AT_ONCE)
        self._channels: dict[str, Channel] = {}
        self._opening: dict[str, asyncio.Task[Channel]] = {}
        self._task: asyncio.Task[None] | None = None
        self._floor: int | None = None
        self._seen: set[int] = set()
        self._keys_checked_at = 0.0

    async def close(self) -> None:
        """Stop reading."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    async def listen(
        self, channel: Channel, *, last_id: int, key_id: str | None
    ) -> AsyncIterator[bytes]:
        """Event after an id, those that happened already first, then new ones as they come.

        Args:
            channel: What is listened to.
            last_id: Only events with greater ids.
            key_id: The key that listens; the stream ends when it is no longer good.
        """
        listener = _Listener(key_id)
        channel, floor = await self._join(channel, listener)
        sent: set[int] = set()
        try:
            while not listener.ended:
                page = await self._before(channel, last_id)
                if not page.ids:
                    break
                # Older ones can't come again.
                sent.update(id_ for id_ in page.ids if id_ > floor)
                yield page.text
                last_id = page.ids[-1]
            while (piece := await listener.queue.get()) is not None:
                if piece.ids[0] not in sent:
                    yield piece.text
        finally:
            self._leave(channel, listener)

    async def open(self, id_: str, *, sweep: bool) -> Channel:
        """Return the channel of a job, or of a sweep and its jobs.

        There is one for all that listen to the same, found by one look at the database.

        Raises:
            UnknownIdError: There is no such job or sweep.
        """
        known = self._channels.get(id_)
        if known is not None:
            return known
        opening = self._opening.get(id_)
        if opening is None:
            opening = asyncio.create_task(self._find(id_, sweep=sweep))
            self._opening[id_] = opening
            opening.add_done_callback(lambda _: self._opening.pop(id_, None))
        return await asyncio.shield(opening)

    async def _find(self, id_: str, *, sweep: bool) -> Channel:
        def job_ids() -> frozenset[str]:
            if not sweep:
                return frozenset({self._store.jobs.get(id_).id})
            self._store.sweeps.get(id_)
            return frozenset(self._store.sweeps.job_ids(id_))

        channel = Channel(id_, is_sweep=sweep, job_ids=await self._run(job_ids))
        for left in [one for one in self._channels.values() if not one.listeners]:
            del self._channels[left.id]
        return self._channels.setdefault(id_, channel)

    async def _before(self, channel: Channel, last_id: int) -> Piece:
        """Return a page of what happened; those who ask for it within a moment share it."""
        reading = channel.pages.get(last_id)
        if reading is None:
            reading = asyncio.create_task(self._read(channel, last_id))
            channel.pages[last_id] = reading
            asyncio.get_running_loop().call_later(POLL_S, channel.pages.pop, last_id)
        return await asyncio.shield(reading)

    async def _read(self, channel: Channel, last_id: int) -> Piece:
        about = {"sweep_id" if channel.is_sweep else "job_id": channel.id}

        def read() -> Piece:
            limit = PAGE if channel.is_sweep else JOB_PAGE
            found = self._store.events.after(last_id, limit=limit, **about)
            texts = event_texts(self._transcripts, found)
            return Piece(tuple(event.id for event in found), b"".join(texts))

        return await self._run(read)

    async def _join(self, channel: Channel, listener: _Listener) -> tuple[Channel, int]:
        """Return the channel that passes events on, and the id up to which none come any more."""
        if self._floor is None:
            self._floor = await self._run(self._store.events.newest)
        # The one that was opened may have been dropped since.
        channel = self._channels.setdefault(channel.id, channel)
        channel.listeners.add(listener)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._poll())
        return channel, self._floor

    def _leave(self, channel: Channel, listener: _Listener) -> None:
        channel.listeners.discard(listener)
        if not channel.listeners and self._channels.get(channel.id) is channel:
            del self._channels[channel.id]

    async def _run(self, read: Callable[[], T]) -> T:
        """Read new events in a background thread."""
        return await to_thread.run_sync(read, limiter=self._threads)

    def _listening(self) -> list[_Listener]:
        return [one for channel in self._channels.values() for one in channel.listeners]

    async def _poll(self) -> None:
        while self._listening():
            await asyncio.sleep(POLL_S)
            try:
                await self._end_streams_of_bad_keys()
                events = await self._new_events()
                fresh = [event for event in events if event.id not in self._seen]
                await self._pass_on(fresh)
            except SQLAlchemyError as error:
                log.warning("events_unreadable", error=str(error).splitlines()[0])
                continue
            self._settle(events)
        self._floor = None
        self._seen.clear()

    async def _new_events(self) -> list[Event]:
        """Everything after what is settled, however much it is."""
        found: list[Event] = []
        last_id = self._floor or 0
        while True:
            page = await self._run(partial(self._store.events.after, last_id, limit=PAGE))
            found += page
            if len(page) < PAGE:
                return found
            last_id = page[-1].id

    async def _end_streams_of_bad_keys(self) -> None:
        now = asyncio.get_running_loop().time()
        if now - self._keys_checked_at < KEYS_EVERY_S:
            return
        self._keys_checked_at = now
        listening = self._listening()
        keys = sorted({one.key_id for one in listening if one.key_id is not None})
        if not keys:
            return
        bad = await self._run(partial(self._store.keys.ended, keys))
        for one in listening:
            if one.key_id in bad:
                one.end()

    async def _pass_on(self, events: list[Event]) -> None:
        channels = list(self._channels.values())
        wanted = [event for event in events if any(one.wants(event) for one in channels)]
        texts = await self._run(partial(event_texts, self._transcripts, wanted)) if wanted else []
        self._seen.update(event.id for event in events)
        for event, text in zip(wanted, texts, strict=True):
            piece = Piece((event.id,), text)
            # Who came while the texts were made has read from the database what was there.
            for channel in self._channels.values():
                if channel.wants(event):
                    for listener in channel.listeners:
                        listener.put(piece)

    def _settle(self, events: list[Event]) -> None:
        """Forget events that are too old for another to appear before them."""
        if not events:
            return
        newest: datetime = max(event.at for event in events)
        settled = [event.id for event in events if event.at < newest - SETTLED_AFTER]
        if settled:
            self._floor = max(settled)
            self._seen = {id_ for id_ in self._seen if id_ > max(settled)}


MAX_TURN_BYTES: Final = 64 << 10
"""A longer turn is sent without its actions and most of its text: the transcript has them."""
SHOWN: Final = 4000
"""Characters of its text that are sent then."""


def event_texts(transcripts: Transcripts, events: Sequence[Event]) -> list[bytes]:
    """Return the events' texts in their order; turns with all that was said and done.

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
