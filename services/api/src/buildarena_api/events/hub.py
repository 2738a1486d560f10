"""The event hub: reads new events once for all who listen, and passes them on."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import structlog
from sqlalchemy.exc import SQLAlchemyError

from buildarena_pipeline.runtime.context import Context
from buildarena_store import Event

log = structlog.get_logger(__name__)

POLL_S = 0.5
SETTLED_AFTER = timedelta(seconds=5)
"""Ids are given out before their transactions end, so an event may appear behind later ones:
reading goes back this far."""
BACKLOG = 10_000
"""Events kept for a slow listener; one that falls further behind is cut off and may come again."""


@dataclass(frozen=True, slots=True, eq=False)
class _Listener:
    sweep_id: str | None
    job_ids: frozenset[str]
    queue: asyncio.Queue[Event | None] = field(
        default_factory=lambda: asyncio.Queue(maxsize=BACKLOG)
    )

    def wants(self, event: Event) -> bool:
        return event.job_id in self.job_ids or (
            self.sweep_id is not None and event.sweep_id == self.sweep_id
        )


class EventHub:
    """Polls the events table while anybody listens.

    Args:
        context: The process' connections.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._listeners: set[_Listener] = set()
        self._task: asyncio.Task[None] | None = None
        self._floor: int | None = None
        self._seen: set[int] = set()

    async def listen(
        self, *, last_id: int, sweep_id: str | None, job_ids: frozenset[str]
    ) -> AsyncIterator[Event]:
        """Events after an id, those that happened already first, then new ones as they come.

        Args:
            last_id: Only events with greater ids.
            sweep_id: A sweep whose own events are wanted, if any.
            job_ids: Jobs whose events are wanted.
        """
        listener = _Listener(sweep_id, job_ids)
        await self._join(listener)
        sent: set[int] = set()
        try:
            while True:
                page = await asyncio.to_thread(self._before, last_id, sweep_id, job_ids)
                for event in page:
                    sent.add(event.id)
                    yield event
                if not page:
                    break
                last_id = page[-1].id
            while (new := await listener.queue.get()) is not None:
                if new.id not in sent:
                    yield new
        finally:
            self._listeners.discard(listener)

    def _before(self, last_id: int, sweep_id: str | None, job_ids: frozenset[str]) -> list[Event]:
        if sweep_id is not None:
            return self._context.store.events.after(last_id, sweep_id=sweep_id)
        (job_id,) = job_ids
        return self._context.store.events.after(last_id, job_id=job_id)

    async def _join(self, listener: _Listener) -> None:
        if self._floor is None:
            self._floor = await asyncio.to_thread(self._context.store.events.newest)
        self._listeners.add(listener)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._poll())

    async def _poll(self) -> None:
        while self._listeners:
            await asyncio.sleep(POLL_S)
            try:
                events = await asyncio.to_thread(self._context.store.events.after, self._floor or 0)
            except SQLAlchemyError as error:
                log.warning("events_unreadable", error=str(error).splitlines()[0])
                continue
            for event in events:
                if event.id not in self._seen:
                    self._seen.add(event.id)
                    self._pass_on(event)
            self._settle(events)
        self._floor = None
        self._seen.clear()

    def _pass_on(self, event: Event) -> None:
        for listener in list(self._listeners):
            if not listener.wants(event):
                continue
            try:
                listener.queue.put_nowait(event)
            except asyncio.QueueFull:
                self._listeners.discard(listener)
                with contextlib.suppress(asyncio.QueueEmpty):
                    listener.queue.get_nowait()
                listener.queue.put_nowait(None)

    def _settle(self, events: list[Event]) -> None:
        """Forgets events that are too old for another to appear before them."""
        if not events:
            return
        newest: datetime = max(event.at for event in events)
        settled = [event.id for event in events if event.at < newest - SETTLED_AFTER]
        if settled:
            self._floor = max(settled)
            self._seen = {id_ for id_ in self._seen if id_ > max(settled)}
