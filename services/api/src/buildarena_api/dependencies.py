"""What routes get handed: the process' connections and the model registry."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Request

from buildarena_pipeline.context import Context
from buildarena_pipeline.external import ExternalSessions
from buildarena_pipeline.models import ModelRegistry
from buildarena_pipeline.submission import Submissions


def _context(request: Request) -> Context:
    context: Context = request.app.state.context
    return context


def _registry(request: Request) -> ModelRegistry:
    registry: ModelRegistry = request.app.state.registry
    return registry


ContextDep = Annotated[Context, Depends(_context)]
RegistryDep = Annotated[ModelRegistry, Depends(_registry)]


def _submissions(request: Request) -> Submissions:
    submissions: Submissions = request.app.state.submissions
    return submissions


def _external(request: Request) -> ExternalSessions:
    sessions: ExternalSessions = request.app.state.external
    return sessions


ExternalDep = Annotated[ExternalSessions, Depends(_external)]
SubmissionsDep = Annotated[Submissions, Depends(_submissions)]
