"""Routes of progress streams: server-sent events of jobs and sweeps."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Header
from pydantic import BaseModel, ConfigDict
from sse_starlette import EventSourceResponse

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import ServicesDep
from buildarena_api.events import EventHub

router = APIRouter(
    prefix="/v1", tags=["events"], dependencies=[limited("streams", until="request")]
)


class StreamEvent(BaseModel):
    """Data of an event; its `event` is the job's or sweep's new state, or `turn`."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)

    job_id: str | None
    """Id of its job, if it is about one."""
    sweep_id: str | None
    """Id of its sweep, if it is about one."""
    at: datetime
    turn: dict[str, Any] | None = None
    """Only in `turn` events: the turn as in the transcript; `shortened` if it is long."""


STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "model": StreamEvent,
        "content": {"text/event-stream": {"schema": {"$ref": "#/components/schemas/StreamEvent"}}},
        "description": "Events as they happen: the schema is that of each one's data",
    }
}
PING_S = 15
SEND_TIMEOUT_S = 60
"""Time for a client to take one piece before its stream ends."""
LastEventId = Annotated[
    int,
    Header(
        alias="Last-Event-ID",
        ge=0,
        le=2**63 - 1,
        description="Only events after this one; browsers send it when they connect again",
    ),
]


@router.get("/jobs/{job_id}/events", response_class=EventSourceResponse, responses=STREAM)
async def stream_job(
    job_id: str, services: ServicesDep, caller: CallerDep, last_event_id: LastEventId = 0
) -> EventSourceResponse:
    """Stream the events of a job, from the beginning or after a given one."""
    return await _stream(services.hub, job_id, last_event_id, caller.key_id, sweep=False)


@router.get("/sweeps/{sweep_id}/events", response_class=EventSourceResponse, responses=STREAM)
async def stream_sweep(
    sweep_id: str, services: ServicesDep, caller: CallerDep, last_event_id: LastEventId = 0
) -> EventSourceResponse:
    """Stream the events of a sweep and its jobs, from the beginning or after a given one."""
    return await _stream(services.hub, sweep_id, last_event_id, caller.key_id, sweep=True)


async def _stream(
    hub: EventHub, id_: str, last_id: int, key_id: str | None, *, sweep: bool
) -> EventSourceResponse:
    await hub.require(id_, sweep=sweep)
    texts = hub.listen(id_, sweep=sweep, last_id=last_id, key_id=key_id)
    return EventSourceResponse(texts, ping=PING_S, send_timeout=SEND_TIMEOUT_S)
