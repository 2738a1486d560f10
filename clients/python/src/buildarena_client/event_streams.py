"""Server-sent events of the service."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final, TypedDict

from buildarena_client.errors import NotAnApiError

if TYPE_CHECKING:
    from httpx2 import ServerSentEvent

MEDIA_TYPE: Final = "text/event-stream"
MAX_EVENT_BYTES: Final = 16 << 20
"""More than any event has: a stream without an end of line is not BuildArena's."""


class Event(TypedDict):
    """Something that happened to a job or a sweep.

    Attributes:
        id: Grows; a stream that begins after it continues behind it.
        kind: What happened.
        job_id: The job it happened to, if it is about one.
        sweep_id: The sweep it is about, if it is about one.
        at: When.
        data: What else there is to say, by kind.
    """

    id: int
    kind: str
    job_id: str | None
    sweep_id: str | None
    at: str
    data: dict[str, Any]


def event_of(message: ServerSentEvent) -> Event:
    """The event that a message carries.

    Raises:
        NotAnApiError: It carries none of the service's.
    """
    try:
        data = json.loads(message.data)
        job_id, sweep_id, at = (data.pop(name, None) for name in ("job_id", "sweep_id", "at"))
        return Event(
            id=int(message.id),
            kind=message.event,
            job_id=job_id,
            sweep_id=sweep_id,
            at=str(at),
            data=data,
        )
    except (ValueError, AttributeError, TypeError) as error:
        raise no_events() from error


def no_events() -> NotAnApiError:
    """The error for a stream that is not one of the service's."""
    return NotAnApiError("the stream holds no events: it is not BuildArena's")
