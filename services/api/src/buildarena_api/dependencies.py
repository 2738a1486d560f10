"""What routes depend on: the process' connections and the model registry."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Query, Request
from pydantic import AfterValidator

from buildarena_api.http.own_pool import OwnPool
from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.process.context import Context
from buildarena_backend.submission.submission import Submissions


async def _context(request: Request) -> Context:
    context: Context = request.app.state.context
    return context


async def _registry(request: Request) -> ModelRegistry:
    registry: ModelRegistry = request.app.state.registry
    return registry


async def _exporting(request: Request) -> OwnPool:
    pool: OwnPool = request.app.state.exporting
    return pool


ExportingDep = Annotated[OwnPool, Depends(_exporting)]
ContextDep = Annotated[Context, Depends(_context)]
RegistryDep = Annotated[ModelRegistry, Depends(_registry)]


async def _submissions(request: Request) -> Submissions:
    submissions: Submissions = request.app.state.submissions
    return submissions


async def _external(request: Request) -> ExternalSessions:
    sessions: ExternalSessions = request.app.state.external
    return sessions


ExternalDep = Annotated[ExternalSessions, Depends(_external)]
SubmissionsDep = Annotated[Submissions, Depends(_submissions)]


def _plus(track: str) -> str:
    return track.replace(" ", "+")


# In a URL a plus is a space to those who read it, and no track has one.
Track = Annotated[str, AfterValidator(_plus)]
IdPrefix = Annotated[
    str | None,
    Query(pattern=r"^[a-z]+_[0-9a-f]*$", max_length=40, description="Only ids with this prefix"),
]
