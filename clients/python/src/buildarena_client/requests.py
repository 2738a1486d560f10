"""Requests and answers as both transports know them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, BinaryIO, Final
from urllib.parse import urlencode

from buildarena_client.errors import BadArgumentError
from buildarena_client.paths import HEALTH, checked_path

JSON: Final = "application/json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What is asked for.

    Attributes:
        method: GET, POST or PUT.
        path: Under the service's URL.
        params: Parameters; those that are None are left out, lists are repeated.
        body: Bytes, or a file that can be read again from its beginning.
        headers: Beside those that every request has.
        repeatable: Whether it may be sent again although it may have been carried out.
        timeout_s: How long nothing may come; None waits forever.
    """

    method: str
    path: str
    params: Mapping[str, Any] = field(default_factory=dict)
    body: bytes | BinaryIO | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    repeatable: bool = False
    timeout_s: float | None = None

    def target(self) -> str:
        """Path and parameters as they are sent.

        Raises:
            BadArgumentError: They would lead elsewhere.
        """
        for name, value in self.headers.items():
            if not (value.isascii() and value.isprintable()):
                raise BadArgumentError(f"{value!r} can't be sent as {name}: use printable ASCII")
        path = checked_path(self.path)
        query = {name: _text(v) for name, v in self.params.items() if v is not None}
        if not query:
            return path
        return path + ("&" if "?" in path else "?") + urlencode(query, doseq=True)

    @property
    def about_health(self) -> bool:
        """Whether it asks for the service's health, whose answer is one whatever its status."""
        return self.path == HEALTH

    def rewind(self) -> None:
        """Lets the body be sent from its beginning."""
        if self.body is not None and not isinstance(self.body, bytes):
            self.body.seek(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """An answer, read to its end.

    Attributes:
        url: What was asked for.
        status: The HTTP status.
        body: Its bytes.
        retry_after: What its header of this name says.
    """

    url: str
    status: int
    body: bytes
    retry_after: str = ""

    @property
    def failed(self) -> bool:
        """Whether it is anything but a success: redirects are not followed."""
        return not 200 <= self.status < 300  # noqa: PLR2004 - HTTP's classes

    def json(self) -> Any:
        """The JSON document that it holds.

        Raises:
            ValueError: It holds none.
        """
        return json.loads(self.body)


def json_body(content: object) -> bytes:
    """A document as it is sent.

    Raises:
        BadArgumentError: It holds something that JSON has no place for.
    """
    try:
        return json.dumps(content, allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise BadArgumentError(f"this can't be sent as JSON: {error}") from error


def _text(value: Any) -> Any:
    """A parameter as the API reads it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_text(item) for item in value]
    return value
