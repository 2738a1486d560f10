"""Cached answers with entity tags: sent only to readers that do not have them yet."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from threading import Lock

from cachetools import LRUCache
from fastapi import Request, Response
from starlette.datastructures import Headers


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A body and the hash by which a reader recognizes it."""

    body: bytes
    etag: str

    @staticmethod
    def of(body: bytes) -> Answer:
        """Return the answer with this body."""
        return Answer(body=body, etag=f'"{sha256(body).hexdigest()[:32]}"')


def has_tag(headers: Headers, etag: str) -> bool:
    """Return whether a reader has the answer with a tag."""
    tags = [tag.strip() for tag in headers.get("if-none-match", "").split(",")]
    return etag in tags or "*" in tags


def conditional(request: Request, answer: Answer, media_type: str) -> Response:
    """Return the answer, or 304 when the reader has it."""
    headers = {"ETag": answer.etag, "Cache-Control": "no-cache"}
    if has_tag(request.headers, answer.etag):
        return Response(status_code=304, headers=headers)
    return Response(answer.body, media_type=media_type, headers=headers)


class ResponseCache:
    """The answers that were used last, by their inputs.

    Args:
        max_bytes: Their bytes together at most.
    """

    def __init__(self, max_bytes: int) -> None:
        self._cached: LRUCache[str, Answer] = LRUCache(
            max_bytes, getsizeof=lambda answer: len(answer.body)
        )
        self._lock = Lock()
        self._making = Lock()

    def get_or_make(self, key: str, make: Callable[[], bytes]) -> Answer:
        """Return the answer with a key.

        Args:
            key: Names everything that it is made from.
            make: Makes its body, one at a time in the process: a large one takes all of a core.
        """
        cached = self._find(key)
        if cached is not None:
            return cached
        with self._making:
            cached = self._find(key)
            if cached is None:
                cached = Answer.of(make())
                # One that is larger than the cache is not stored.
                with self._lock, suppress(ValueError):
                    self._cached[key] = cached
            return cached

    def _find(self, key: str) -> Answer | None:
        with self._lock:
            return self._cached.get(key)
