"""The FastAPI application."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Final

from fastapi import Depends, FastAPI
from fastapi.routing import APIRoute
from fastapi_offline import FastAPIOffline
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from buildarena_api.access import admin_of, admission, caller_of, known_sender
from buildarena_api.dashboard import Dashboard, is_page
from buildarena_api.dependencies import Services
from buildarena_api.http.bodies import BodyLimitMiddleware
from buildarena_api.http.forwarded_headers import (
    BasePathMiddleware,
    LocalOnlyMiddleware,
    RootPathMiddleware,
)
from buildarena_api.http.log import RequestLog
from buildarena_api.http.methods import MethodMiddleware
from buildarena_api.http.openapi import describe
from buildarena_api.http.pages import known_parameters
from buildarena_api.http.places import OpenRequests
from buildarena_api.http.problems import add_problem_handlers
from buildarena_api.job_records import preview_job
from buildarena_api.routes import (
    catalogue,
    events,
    exports,
    health,
    jobs,
    keys,
    leaderboard,
    machines,
    runner,
    sessions,
    sweeps,
    tasks,
    trials,
    verifications,
)
from buildarena_api.runners.outcomes import drop_dead_uploads
from buildarena_backend import __version__
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.periodic import Periodic
from buildarena_backend.process.context import Context
from buildarena_backend.process.reaper import Reaper

POOL_SIZE: Final = 10
"""Connections for requests."""
DROP_EVERY_S: Final = 60.0
"""Time between removals of dead leases' uploads."""
ROUTERS: Final = (
    # Those before `jobs` whose artifacts have paths like theirs.
    *(jobs.transcripts, trials.pictures, leaderboard.router, exports.router, events.router),
    *(machines.router, trials.router, jobs.router, health.metrics, verifications.router),
    *(sessions.router, sweeps.router, tasks.router, catalogue.router),
)
"""Routers for any key that may read; each limits its concurrent requests."""
DESCRIPTION = """Find out whether language models can engineer: submit task x model x seed jobs,
watch machines being built and simulated, and read the leaderboard. Errors are RFC 9457 problem
details that name the field and the valid choices.

[Leaderboard](./) · [jobs](./jobs) · [sweeps](./sweeps)"""


def create_app(context: Context, registry: ModelRegistry) -> FastAPI:
    """Yield the application on top of a process' connections.

    Args:
        context: Connections; they stay the caller's to close.
    """
    services = Services(context, registry)
    clean = partial(drop_dead_uploads, context, services.uploads)
    threads = (Reaper(context), Periodic(clean, name="uploads", period_s=DROP_EVERY_S))

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        for thread in threads:
            thread.start()
        yield
        await services.parts.settle()
        for thread in threads:
            thread.stop()
        await services.rate_limits.close()
        services.watching.store.database.close()

    # Its documentation page needs nothing from elsewhere.
    app = FastAPIOffline(
        title="BuildArena",
        version=__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url="/docs",
        swagger_ui_parameters={"docExpansion": "none", "defaultModelsExpandDepth": -1},
        redoc_url=None,
        redirect_slashes=False,
        # `RequestLog` makes the spans: FastAPI's have queries, and the messages of exceptions.
        telemetry={"tracing": False, "metrics": False, "logs": False},
        # Short names for the functions of generated clients.
        generate_unique_id_function=lambda route: route.name,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
    )
    app.state.services = services
    add_problem_handlers(app)
    _add_routes(app)
    # Behind every route, so that no page can replace one.
    base = context.settings.base_path
    # Previews are read without a key, so a service that requires keys has none.
    preview = None if context.settings.require_keys else partial(preview_job, context)
    app.router.default = Dashboard(app.router.default, base=base, preview=preview)
    _add_middleware(app, services)
    return app


def _add_routes(app: FastAPI) -> None:
    checked = Depends(known_parameters)
    app.include_router(health.router, dependencies=[checked])
    for router in ROUTERS:
        app.include_router(router, dependencies=[Depends(caller_of), checked])
    app.include_router(keys.router, dependencies=[Depends(admin_of), checked])
    app.include_router(runner.router, dependencies=[checked])
    describe(app)


def all_routes() -> list[APIRoute]:
    """Return every route of the application."""
    return [
        route
        for router in (health.router, runner.router, keys.router, *ROUTERS)
        for route in router.routes
        if isinstance(route, APIRoute)
    ]


def _add_middleware(app: FastAPI, services: Services) -> None:
    """Add the middleware; the last one added is the first that a request meets."""
    settings = services.context.settings
    if settings.base_path:
        app.add_middleware(RootPathMiddleware, base=settings.base_path)
    app.add_middleware(
        BodyLimitMiddleware,
        documents={tasks.PATH, machines.CHECK_PATH, machines.TRIAL_PATH},
        is_upload=runner.is_upload,
        limit_of=runner.max_request_bytes,
        admit=admission(services),
        places=services.places["bodies"],
    )
    app.add_middleware(MethodMiddleware, routes=all_routes())
    if not settings.require_keys:
        app.add_middleware(LocalOnlyMiddleware, is_page=is_page)
    app.add_middleware(RequestLog, metrics=services.metrics)
    app.add_middleware(OpenRequests, caller_of=known_sender(services))
    if settings.base_path:
        app.add_middleware(BasePathMiddleware, base=settings.base_path)
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=settings.trusted_proxies)
