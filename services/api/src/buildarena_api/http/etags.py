"""Answers that are not sent again to a reader who has them."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

from fastapi import Request, Response


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A body and the hash by which a reader can tell that it has it already."""

    body: bytes
    etag: str

    @staticmethod
    def of(body: bytes) -> Answer:
        """The answer with this body."""
        return Answer(body=body, etag=f'"{sha256(body).hexdigest()[:32]}"')


def conditional(request: Request, answer: Answer, media_type: str) -> Response:
    """The answer, or 304 when the reader has it."""
    headers = {"ETag": answer.etag, "Cache-Control": "no-cache"}
    known = [tag.strip() for tag in request.headers.get("if-none-match", "").split(",")]
    if answer.etag in known or "*" in known:
        return Response(status_code=304, headers=headers)
    return Response(answer.body, media_type=media_type, headers=headers)
