"""`Idempotency-Key`: a request that is sent again creates nothing a second time."""

from __future__ import annotations

from hashlib import sha256
from typing import Annotated

from fastapi import Depends, Header, Request

from buildarena_api.dependencies import ServicesDep
from buildarena_api.http.codes import ErrorCode
from buildarena_api.http.problems import ProblemError
from buildarena_backend.ids import content_hash

GivenKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="A request with the same key and body creates nothing a second time; with the "
        "same key and another body it is refused",
    ),
]


async def _request_key(
    request: Request, services: ServicesDep, given: GivenKey = None
) -> str | None:
    """A name for what the request creates, one caller's apart from another's; None without key.

    Raises:
        ProblemError: The key was used for another request within a day.
    """
    if given is None:
        return None
    name = content_hash([request.state.caller.key_id, request.url.path, given])
    said = sha256(request.url.query.encode() + b"\n" + await request.body()).hexdigest()
    if await services.rate_limits.first_said(f"idempotency:{name}", said) != said:
        detail = "this Idempotency-Key was used for another request"
        raise ProblemError(ErrorCode.IDEMPOTENCY_KEY_REUSED, detail)
    return name


RequestKey = Annotated[str | None, Depends(_request_key)]
