"""The FastAPI application."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI
from fastapi_offline import FastAPIOffline

from buildarena_api.events.hub import EventHub
from buildarena_api.http.access import caller_of
from buildarena_api.http.limits import BodyLimitMiddleware
from buildarena_api.http.log import RequestLog
from buildarena_api.http.metrics import ServiceMetrics
from buildarena_api.http.problems import add_problem_handlers, problem_responses
from buildarena_api.http.rate_limits import RateLimits
from buildarena_api.leaderboard.cache import BoardCache
from buildarena_api.routes import (
    archives,
    catalogue,
    events,
    health,
    jobs,
    keys,
    leaderboard,
    metrics,
    sessions,
    sweeps,
    tasks,
    verifications,
)
from buildarena_pipeline import __version__
from buildarena_pipeline.agents.sessions import ExternalSessions
from buildarena_pipeline.catalog.models import ModelRegistry
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.reaper import Reaper
from buildarena_pipeline.submission.submission import Submissions

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

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        reaper.start()
        yield
        reaper.stop()

    # Its documentation page needs nothing from elsewhere.
    app = FastAPIOffline(
        title="BuildArena",
        version=__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url="/docs",
        redoc_url=None,
        # Short names for the functions of generated clients.
        generate_unique_id_function=lambda route: route.name,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
    )
    app.state.metrics = ServiceMetrics(context)
    app.add_middleware(BodyLimitMiddleware, unlimited={archives.IMPORT_PATH})
    app.add_middleware(RequestLog, metrics=app.state.metrics)
    app.state.context = context
    app.state.artifact_probe = health.ArtifactProbe(context.artifacts)
    app.state.hub = EventHub(context)
    app.state.registry = registry
    app.state.boards = BoardCache(context.store.results.boards, context.tasks)
    app.state.submissions = Submissions(context, registry)
    app.state.external = ExternalSessions(context)
    app.state.rate_limits = RateLimits(
        context.settings.required_broker_url(), context.settings.rate_limit
    )
    add_problem_handlers(app)
    app.include_router(health.router)
    for route in (
        verifications,
        sessions,
        events,
        jobs,
        sweeps,
        leaderboard,
        tasks,
        catalogue,
        keys,
        metrics,
        archives,
    ):
        app.include_router(
            route.router,
            dependencies=[Depends(caller_of)],
            responses=problem_responses(401, 403, 429),
        )
    return app
