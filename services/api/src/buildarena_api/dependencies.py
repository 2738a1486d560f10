"""Dependencies of routes: the process' services, and parts of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Annotated

from fastapi import Depends, Header, Query, Request
from pydantic import AfterValidator

from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.ids import content_hash
from buildarena_backend.process.context import Context

if TYPE_CHECKING:
    from buildarena_api.events import EventHub
    from buildarena_api.http.api_key_cache import ApiKeyVerifier
    from buildarena_api.http.etags import ResponseCache
    from buildarena_api.http.metrics import ServiceMetrics
    from buildarena_api.http.parts import Parts
    from buildarena_api.http.places import Kind, Places
    from buildarena_api.http.rate_limits import RateLimits
    from buildarena_api.leaderboard.cache import BoardCache
    from buildarena_api.replays import Replays
    from buildarena_api.runners.outcomes import RunnerService
    from buildarena_backend.agents.sessions import ExternalSessions
    from buildarena_backend.submission.submission import Submissions


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
    request: Request, services: ServicesDep, request_key: GivenKey = None
) -> str | None:
    """Return a name for the request's new object, unique to the caller; None without key.

    Raises:
        ProblemError: The key was used for another request within a day.
    """
    if request_key is None:
        return None
    name = content_hash([request.state.caller.key_id, request.url.path, request_key])
    digest = sha256(request.url.query.encode() + b"\n" + await request.body()).hexdigest()
    if await services.rate_limits.store_first(f"idempotency:{name}", digest) != digest:
        detail = "this Idempotency-Key was used for another request"
        raise ProblemError(ErrorCode.IDEMPOTENCY_KEY_REUSED, detail)
    return name


RequestKey = Annotated[str | None, Depends(_request_key)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Services:
    """All that serves requests in one process.

    Attributes:
        places: Limits of concurrent requests, by kind.
        pictures: GLB files, thumbnails, and what trials are drawn from.
    """

    context: Context
    registry: ModelRegistry
    submissions: Submissions
    external: ExternalSessions
    runners: RunnerService
    hub: EventHub
    boards: BoardCache
    replays: Replays
    pictures: ResponseCache
    key_checks: ApiKeyVerifier
    rate_limits: RateLimits
    places: Mapping[Kind, Places]
    parts: Parts
    metrics: ServiceMetrics


def services_of(request: Request) -> Services:
    """Return the services that handle a request."""
    services: Services = request.app.state.services
    return services


async def _services(request: Request) -> Services:
    return services_of(request)


ServicesDep = Annotated[Services, Depends(_services)]


async def _context(services: ServicesDep) -> Context:
    return services.context


async def _registry(services: ServicesDep) -> ModelRegistry:
    return services.registry


ContextDep = Annotated[Context, Depends(_context)]
RegistryDep = Annotated[ModelRegistry, Depends(_registry)]


def _plus(track: str) -> str:
    return track.replace(" ", "+")


# In a URL a plus is a space to those who read it, and no track has one.
Track = Annotated[str, AfterValidator(_plus)]
IdPrefix = Annotated[
    str | None,
    Query(pattern=r"^[a-z]+_[0-9a-f]*$", max_length=40, description="Only ids with this prefix"),
]
