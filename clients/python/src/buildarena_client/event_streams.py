"""Server-sent events: pieces of a stream become events, wherever it is cut."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final, TypedDict

from buildarena_client.errors import NotAnApiError

MAX_EVENT_BYTES: Final = 16 << 20
"""More than any event has: a stream without an end of line is none of ours."""


class Event(TypedDict):
    """Something that happened to a job or a sweep.

    Attributes:
        id: Grows; a stream that begins after it goes on behind it.
        kind: What happened.
        job: The job it happened to, if it is about one.
        sweep: The sweep it is about, if it is about one.
        at: When.
        data: What else there is to say, by kind.
    """

    id: int
    kind: str
    job: str | None
    sweep: str | None
    at: str
    data: dict[str, Any]


class EventReader:
    """Reads events from a stream's pieces."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, piece: bytes) -> Iterator[Event]:
        """Events that are whole with this piece.

        Raises:
            NotAnApiError: These are no events of the service.
        """
        # A line may end with either or both; a pair may be cut in two.
        text = (self._rest + piece).replace(b"\r\n", b"\n")
        *blocks, self._rest = text.split(b"\n\n")
        if len(self._rest) > MAX_EVENT_BYTES:
            raise NotAnApiError("the stream holds no events: it is not BuildArena's")
        for block in blocks:
            event = _event(block)
            if event is not None:
                yield event


def _event(block: bytes) -> Event | None:
    """The event of a block; None for one that keeps the connection open."""
    fields: dict[str, list[str]] = {}
    for line in block.decode("utf-8", "replace").split("\n"):
        name, _, value = line.partition(":")
        if name:
            fields.setdefault(name, []).append(value.removeprefix(" "))
    if "data" not in fields or "id" not in fields:
        return None
    try:
        content = json.loads("\n".join(fields["data"]))
        known = {name: content.pop(name, None) for name in ("job", "sweep", "at")}
        return Event(
            id=int(fields["id"][-1]),
            kind=fields.get("event", ["message"])[-1],
            job=known["job"],
            sweep=known["sweep"],
            at=str(known["at"]),
            data=content,
        )
    except (ValueError, AttributeError, TypeError) as error:
        raise NotAnApiError("the stream holds no events: it is not BuildArena's") from error
