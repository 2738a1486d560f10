"""Requests of pages, and their responses as a site stores them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from buildarena_cli.site.folder import as_json
from buildarena_client.client import Client
from buildarena_client.errors import NotFoundError, UnreachableError
from buildarena_client.retries import RetryPolicy

PAUSE_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer.

    Attributes:
        content: Its bytes.
        ending: The ending of its file.
    """

    content: bytes
    ending: str = "json"


Answers = dict[str, Answer | None]
"""Answers by question; None where the service has none."""


def question(path: str, params: Mapping[str, Any] | None = None) -> str:
    """Return the key by which pages look up a response: decoded, with sorted parameters."""
    pairs = sorted(
        f"{name}={value}"
        for name, param in (params or {}).items()
        for value in (
            param if isinstance(param, Sequence) and not isinstance(param, str) else [param]
        )
        if value is not None
    )
    return path + ("?" + "&".join(pairs) if pairs else "")


def fetch(client: Client, path: str, *, accept: str | None = None, **params: Any) -> bytes | None:
    """Return the bytes of an answer; None if the resource does not exist.

    Waits while the service restarts.
    """
    deadline = time.monotonic() + RetryPolicy().restart_s
    while True:
        try:
            return client.get_bytes(path, accept=accept, **params)
        except NotFoundError:
            return None
        except UnreachableError:
            if time.monotonic() > deadline:
                raise
            time.sleep(PAUSE_S)


def ask(client: Client, path: str, *, ending: str = "json", **params: Any) -> Answer | None:
    """Return an answer, see `fetch`, with the ending of its file."""
    content = fetch(client, path, **params)
    return None if content is None else Answer(content, ending)


def document(value: Any) -> Answer:
    """Return a JSON document as an answer."""
    return Answer(as_json(value))


def page(rows: Sequence[Any]) -> Answer:
    """Return a whole list as an answer."""
    return document({"data": list(rows), "next_cursor": None})
