"""Routes of progress streams: server-sent events of jobs and sweeps."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from fastapi.concurrency import run_in_threadpool
from sse_starlette import EventSourceResponse, ServerSentEvent

from buildarena_api.dependencies import ContextDep
from buildarena_api.events.hub import EventHub
from buildarena_api.http.problems import problem_responses
from buildarena_store import Event

router = APIRouter(prefix="/v1", tags=["events"])

STREAM: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/event-stream": {}}, "description": "Events as they happen"}
}
PING_S = 15
LastEventId = Annotated[
    int,
    Header(
        alias="Last-Event-ID",
        ge=0,
        le=2**63 - 1,
        description="Only events after this one; browsers send it when they connect again",
    ),
]


@router.get(
    "/jobs/{job_id}/events",
    response_class=EventSourceResponse,
    responses=STREAM | problem_responses(404, 422, 503),
)
async def stream_job(
    job_id: str, context: ContextDep, request: Request, last_event_id: LastEventId = 0
) -> EventSourceResponse:
    """Streams the events of a job, from the beginning or after a given one."""
    await run_in_threadpool(context.store.jobs.get, job_id)
    hub: EventHub = request.app.state.hub
    events = hub.listen(last_id=last_event_id, sweep_id=None, job_ids=frozenset({job_id}))
    return EventSourceResponse(_sent(events), ping=PING_S)


@router.get(
    "/sweeps/{sweep_id}/events",
    response_class=EventSourceResponse,
    responses=STREAM | problem_responses(404, 422, 503),
)
async def stream_sweep(
    sweep_id: str, context: ContextDep, request: Request, last_event_id: LastEventId = 0
) -> EventSourceResponse:
    """Streams the events of a sweep and its jobs, from the beginning or after a given one."""
    await run_in_threadpool(context.store.sweeps.get, sweep_id)
    job_ids = frozenset(await run_in_threadpool(context.store.sweeps.job_ids, sweep_id))
    hub: EventHub = request.app.state.hub
    events = hub.listen(last_id=last_event_id, sweep_id=sweep_id, job_ids=job_ids)
    return EventSourceResponse(_sent(events), ping=PING_S)


async def _sent(events: AsyncIterator[Event]) -> AsyncIterator[ServerSentEvent]:
    async for event in events:
        data = {
            "job": event.job_id,
            "sweep": event.sweep_id,
            "at": event.at.isoformat(),
            **event.data,
        }
        yield ServerSentEvent(json.dumps(data), event=event.kind, id=str(event.id))
