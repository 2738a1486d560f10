"""What routes depend on: all that one process has, and their own pieces of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from fastapi import Depends, Query, Request
from pydantic import AfterValidator

from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.process.context import Context

if TYPE_CHECKING:
    from buildarena_api.events.hub import EventHub
    from buildarena_api.http.etags import ResponseCache
    from buildarena_api.http.key_checks import KeyChecks
    from buildarena_api.http.metrics import ServiceMetrics
    from buildarena_api.http.parts import Parts
    from buildarena_api.http.places import Kind, Places
    from buildarena_api.http.rate_limits import RateLimits
    from buildarena_api.leaderboard.cache import BoardCache
    from buildarena_api.replays.making import Replays
    from buildarena_api.runners.service import RunnerService
    from buildarena_backend.agents.sessions import ExternalSessions
    from buildarena_backend.submission.submission import Submissions


@dataclass(frozen=True, slots=True, kw_only=True)
class Services:
    """All that serves requests in one process.

    Attributes:
        context: The process' connections.
        registry: The models that jobs can name.
        places: How much of what goes on at once, by kind.
        pictures: GLB files and thumbnails.
        scenes: What trials are drawn from.
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
    scenes: ResponseCache
    key_checks: KeyChecks
    rate_limits: RateLimits
    places: Mapping[Kind, Places]
    parts: Parts
    metrics: ServiceMetrics


def services_of(request: Request) -> Services:
    """What serves a request."""
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
