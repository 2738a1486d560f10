"""The FastAPI application."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI
from fastapi.routing import APIRoute
from fastapi_offline import FastAPIOffline
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from buildarena_api.dashboard.files import read_pages
from buildarena_api.dashboard.serving import Dashboard, is_page
from buildarena_api.events.hub import EventHub
from buildarena_api.http.access import admission, caller_of, known_key
from buildarena_api.http.admission import BodyBuffers
from buildarena_api.http.concurrency import limited, usual_limits
from buildarena_api.http.infrastructure import InfrastructureMetrics
from buildarena_api.http.key_checks import KeyChecks
from buildarena_api.http.limits import BodyLimitMiddleware
from buildarena_api.http.locality import LocalOnlyMiddleware
from buildarena_api.http.log import RequestLog
from buildarena_api.http.methods import MethodMiddleware
from buildarena_api.http.metrics import ServiceMetrics
from buildarena_api.http.outer_address import (
    BasePathMiddleware,
    ForwardedHostMiddleware,
    RootPathMiddleware,
)
from buildarena_api.http.overload import OverloadMiddleware
from buildarena_api.http.own_pool import OwnPool
from buildarena_api.http.probes import Probes
from buildarena_api.http.problems import add_problem_handlers, problem_responses
from buildarena_api.http.rate_limits import RateLimits
from buildarena_api.http.response_cache import ResponseCache
from buildarena_api.http.weights import Weights
from buildarena_api.leaderboard.cache import BoardCache
from buildarena_api.replays.making import Replays
from buildarena_api.routes import (
    callers,
    catalogue,
    events,
    exports,
    health,
    jobs,
    keys,
    leaderboard,
    machines,
    metrics,
    pictures,
    replays,
    runner,
    sessions,
    simulators,
    sweeps,
    tasks,
    transcript_search,
    trials,
    verifications,
    versions,
    workers,
)
from buildarena_api.runners.service import RunnerService
from buildarena_backend import __version__
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.process.context import Context
from buildarena_backend.process.reaper import Reaper
from buildarena_backend.settings import Settings
from buildarena_backend.submission.submission import Submissions
from buildarena_backend.trials.known_simulators import configured_simulators

POOL_SIZE = 10
"""Connections for ordinary requests."""
WATCHERS = 3
"""Threads and connections for key checks and event streams."""
EXPORTERS = 4
"""Threads and connections for exports: as many as may go on at once."""
ORDINARY = (
    verifications,
    sessions,
    machines,
    replays,  # before jobs, whose artifacts have paths like theirs
    transcript_search,
    trials,
    pictures,
    jobs,
    sweeps,
    leaderboard,
    tasks,
    catalogue,
    callers,
    keys,
    simulators,
    versions,
    workers,
)
LIMITED_THEMSELVES = (events, exports, metrics)
"""Routes whose requests don't count among a caller's ordinary ones: they take long, or no
thread."""
DESCRIPTION = """Find out whether language models can engineer: submit task x model x seed jobs,
watch machines being built and simulated, and read the leaderboard. Errors are RFC 9457 problem
details that name the field and the valid choices."""


def create_app(context: Context, registry: ModelRegistry) -> FastAPI:
    """The application on top of a process' connections.

    Args:
        context: Connections; they stay the caller's to close.
        registry: The models that jobs can name.
    """
    reaper = Reaper(context)
    probes = Probes(context)
    watching = OwnPool(context, size=WATCHERS, name="watching")
    exporting = OwnPool(context, size=EXPORTERS, name="exporting")
    rate_limits = RateLimits(context.settings.required_broker_url(), context.settings.rate_limit)

    hub = EventHub(watching)
    runners = RunnerService(context)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        probes.start()
        reaper.start()
        runners.start()
        yield
        reaper.stop()
        await asyncio.to_thread(probes.close)
        runners.close()
        await hub.close()
        await rate_limits.close()
        watching.close()
        exporting.close()

    # Its documentation page needs nothing from elsewhere.
    app = FastAPIOffline(
        title="BuildArena",
        version=__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url="/docs",
        redoc_url=None,
        # `RequestLog` makes the spans: FastAPI's have queries, and the messages of exceptions.
        telemetry={"tracing": False, "metrics": False, "logs": False},
        # Short names for the functions of generated clients.
        generate_unique_id_function=lambda route: route.name,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
    )
    app.state.probes = probes
    app.state.metrics = ServiceMetrics(
        probes,
        simulators=configured_simulators(context.settings),
        models=[model.name for model in registry.models.values()],
    )
    app.state.context = context
    app.state.metrics.registry.register(
        InfrastructureMetrics(
            context,
            probes,
            {
                "ordinary": context.store.database.engine,
                "watching": watching.context.store.database.engine,
                "exporting": exporting.context.store.database.engine,
            },
        )
    )
    app.state.exporting = exporting
    app.state.hub = hub
    app.state.runners = runners
    app.state.key_checks = KeyChecks(watching)
    app.state.concurrency = usual_limits()
    app.state.body_buffers = BodyBuffers()
    app.state.registry = registry
    app.state.boards = BoardCache(context.store.results.boards, context.tasks)
    app.state.scenes = ResponseCache(trials.MAX_CACHED_SCENES)
    app.state.pictures = ResponseCache(pictures.MAX_CACHED_PICTURES)
    app.state.replays = Replays(context)
    app.state.submissions = Submissions(context, registry)
    app.state.external = ExternalSessions(context)
    app.state.rate_limits = rate_limits
    add_problem_handlers(app)
    _add_routes(app)
    # Behind every route, so that no page can stand in the place of one.
    base = context.settings.base_path
    app.router.default = Dashboard(read_pages(base=base), app.router.default, base=base)
    _add_middleware(app)
    return app


def _add_routes(app: FastAPI) -> None:
    app.include_router(health.router)
    for route in (*LIMITED_THEMSELVES, *ORDINARY):
        own = [] if route in LIMITED_THEMSELVES else [limited()]
        app.include_router(
            route.router,
            dependencies=[Depends(caller_of), *own],
            responses=problem_responses(401, 403, 429),
        )
    app.include_router(runner.router, responses=problem_responses(401, 403, 429))


def all_routes() -> list[APIRoute]:
    """Every route of the application."""
    return [
        found
        for part in (health, runner, *ORDINARY, *LIMITED_THEMSELVES)
        for found in part.router.routes
        if isinstance(found, APIRoute)
    ]


def _add_middleware(app: FastAPI) -> None:
    """The last one added is the first that a request meets."""
    settings: Settings = app.state.context.settings
    if settings.base_path:
        app.add_middleware(RootPathMiddleware, base=settings.base_path)
    app.add_middleware(
        BodyLimitMiddleware,
        documents={tasks.PATH, machines.CHECK_PATH, machines.TRIAL_PATH},
        pieces=runner.is_piece,
        most=runner.max_request_bytes,
        admit=admission(app),
        buffers=app.state.body_buffers,
    )
    routes = all_routes()
    methods = [(found.path, found.methods or ()) for found in routes]
    app.add_middleware(MethodMiddleware, routes=methods)
    if not settings.require_keys:
        app.add_middleware(LocalOnlyMiddleware, is_page=is_page)
    app.add_middleware(RequestLog, metrics=app.state.metrics)
    app.add_middleware(OverloadMiddleware, known=known_key(app), weights=Weights(routes))
    if settings.base_path:
        app.add_middleware(BasePathMiddleware, base=settings.base_path)
    if settings.trusted_proxies:
        trusted = settings.trusted_proxies
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=trusted)
        # Without keys the host itself says who may ask, and a page in a browser could send another.
        if settings.require_keys:
            app.add_middleware(ForwardedHostMiddleware, trusted=trusted)
