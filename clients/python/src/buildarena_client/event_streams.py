"""Server-sent events of the service."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final, TypedDict

from buildarena_client.errors import NotAnApiError

if TYPE_CHECKING:
    from httpx2 import ServerSentEvent

MEDIA_TYPE: Final = "text/event-stream"
MAX_EVENT_BYTES: Final = 16 << 20
"""Maximum size of an event: a stream without a line end is not BuildArena's."""


class Event(TypedDict):
    """An event of a job or a sweep.

    Attributes:
        id: Increasing number; a stream that begins after it continues behind it.
        job_id: Job of the event, if any.
        sweep_id: Sweep of the event, if any.
        at: Time of the event.
        data: Further data, by kind.
    """

    id: int
    kind: str
    job_id: str | None
    sweep_id: str | None
    at: str
    data: dict[str, Any]


def event_of(message: ServerSentEvent) -> Event:
    """Return the event in a message.

    Raises:
        NotAnApiError: It contains none of the service's.
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
    """Return the error for a stream that is not one of the service's."""
    return NotAnApiError("the stream holds no events: it is not BuildArena's")
