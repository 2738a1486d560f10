"""Dependencies of routes: the process' services, and parts of them."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from typing import Annotated, Final

from fastapi import Depends, Header, Query, Request
from pydantic import AfterValidator

from buildarena_api.events import EventHub
from buildarena_api.http.api_key_cache import ApiKeyVerifier
from buildarena_api.http.etags import ResponseCache
from buildarena_api.http.metrics import ServiceMetrics
from buildarena_api.http.parts import Parts
from buildarena_api.http.places import usual_places
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_api.http.rate_limits import RateLimits
from buildarena_api.leaderboard.cache import BoardCache
from buildarena_api.replays import Replays
from buildarena_api.runners.lease_queue import LeaseQueue
from buildarena_api.runners.outcomes import Outcomes
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.artifacts.uploads import Uploads
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.database.database import Database
from buildarena_backend.ids import content_hash
from buildarena_backend.process.context import Context
from buildarena_backend.store import Store
from buildarena_backend.submission.submission import Submissions

WATCHING: Final = 4
"""Connections for key checks, event streams and health checks."""
POOL_TIMEOUT_S: Final = 2.0
"""Wait of a request for a database connection before it is answered with 503."""
MAX_CACHED_PICTURES: Final = 64 << 20
"""Bytes of GLB files, pictures and scenes in memory."""
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


class Services:
    """All that serves requests in one process.

    Args:
        context: Connections of ordinary requests.

    Attributes:
        watching: The same with separate connections: for key checks, event streams and health.
        places: Limits of concurrent requests, by kind.
        pictures: GLB files, thumbnails, and what trials are drawn from.
    """

    def __init__(self, context: Context, registry: ModelRegistry) -> None:
        settings = context.settings
        self.context, self.registry = context, registry
        self.watching = _watching(context)
        self.submissions = Submissions(context, registry)
        self.external = ExternalSessions(context)
        self.uploads = Uploads(settings.artifacts_location, settings.artifact_options)
        self.lease_queue = LeaseQueue(context)
        self.outcomes = Outcomes(context, self.uploads)
        self.hub = EventHub(self.watching)
        self.boards = BoardCache(context.store.results.boards, context.tasks, registry.is_baseline)
        self.replays = Replays(context)
        self.pictures = ResponseCache(MAX_CACHED_PICTURES)
        self.key_checks = ApiKeyVerifier(self.watching.store.keys)
        self.rate_limits = RateLimits(settings.required_broker_url(), settings.rate_limit)
        self.places = usual_places()
        self.parts = Parts(self.watching)
        pools = {"ordinary": context, "watching": self.watching}
        self.metrics = ServiceMetrics(
            context,
            self.parts,
            pools={name: of.store.database.engine for name, of in pools.items()},
            models=[model.name for model in registry.models.values()],
        )


def _watching(context: Context) -> Context:
    """Return the same with separate connections."""
    settings = context.settings
    database = Database(
        settings.required_database_url(),
        pool_size=WATCHING,
        pool_timeout_s=POOL_TIMEOUT_S,
        name="buildarena-api watching",
    )
    store = Store(database, lease_s=settings.lease_s, max_faults=settings.max_faults)
    return replace(context, store=store, tasks=TaskCatalog(store.tasks))


def services_of(request: Request) -> Services:
    """Return the services that handle a request."""
    services: Services = request.app.state.services
    return services


async def _services(request: Request) -> Services:
    return services_of(request)


ServicesDep = Annotated[Services, Depends(_services)]


async def _context(services: ServicesDep) -> Context:
    return services.context


ContextDep = Annotated[Context, Depends(_context)]


def _plus(track: str) -> str:
    return track.replace(" ", "+")


# In a URL a plus is a space to those who read it, and no track has one.
Track = Annotated[str, AfterValidator(_plus)]
IdPrefix = Annotated[
    str | None,
    Query(pattern=r"^[a-z]+_[0-9a-f]*$", max_length=40, description="Only ids with this prefix"),
]
