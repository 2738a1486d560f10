"""Routes of what machines and modules look like: GLB files and thumbnails."""

from __future__ import annotations

import json
from difflib import get_close_matches
from functools import cache
from typing import Final

from fastapi import APIRouter, Request, Response

from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.etags import Answer, conditional
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState
from buildarena_geometry import DocumentError, Machine, module_set
from buildarena_geometry.export import machine_glb, module_glb
from buildarena_simulation import MachineNotSimulable
from buildarena_simulation.render.still import still_png

router = APIRouter(prefix="/v1", tags=["pictures"])

GLB: Final = "model/gltf-binary"
PNG: Final = "image/png"
THUMBNAIL: Final = "thumbnail"
MAX_CACHED_PICTURES: Final = 64 << 20
"""Bytes of GLB files and pictures in memory."""


@router.get(
    "/modules/{name}.glb",
    response_class=Response,
    responses={200: {"content": {GLB: {}}}, **problem_responses(404)},
)
def module_model(name: str, request: Request) -> Response:
    """A module as a GLB file, its root point at the origin; a connector as a rod of length 1."""
    return conditional(request, _module_answer(name), GLB)


@router.get(
    "/jobs/{job_id}/machine.glb",
    response_class=Response,
    responses={200: {"content": {GLB: {}}}, **problem_responses(404, 503)},
)
def machine_model(
    job_id: str, context: ContextDep, services: ServicesDep, request: Request
) -> Response:
    """The job's machine as a GLB file: a node for each part, named by its id."""
    digest = _machine_hash(context, context.store.jobs.get(job_id))
    answer = services.pictures.get_or_make(
        f"glb {digest}", lambda: machine_glb(_machine(context, digest, job_id))
    )
    return conditional(request, answer, GLB)


@router.get(
    "/jobs/{job_id}/thumbnail.png",
    response_class=Response,
    responses={200: {"content": {PNG: {}}}, **problem_responses(404, 503)},
)
def thumbnail(
    job_id: str, context: ContextDep, services: ServicesDep, request: Request
) -> Response:
    """A picture of the job's machine where its trial puts it, 480 x 320 pixels.

    It is drawn when it is first asked for; that of an ended job is then one of its artifacts.
    """
    job = context.store.jobs.get(job_id)
    digest = _machine_hash(context, job)
    answer = services.pictures.get_or_make(
        f"png {digest} {job.task} {job.task_version} {job.state}",
        lambda: _thumbnail(context, job, digest),
    )
    return conditional(request, answer, PNG)


@cache
def _module_models() -> dict[str, Answer]:
    # The cargo of the basic set has a shape too, and the name of a module of the others.
    modules = {**module_set("basic"), **module_set("all")}
    return {name: Answer.of(module_glb(module)) for name, module in modules.items()}


def _module_answer(name: str) -> Answer:
    found = _module_models().get(name)
    if found is None:
        near = get_close_matches(name, _module_models(), n=3, cutoff=0.0)
        raise ProblemError(404, f"there is no module {name!r}; the nearest are {', '.join(near)}")
    return found


def _machine_hash(context: Context, job: Job) -> str:
    digest = context.store.jobs.artifacts(job.id).get("machine")
    if digest is None:
        raise ProblemError(404, f"job {job.id} has no machine yet")
    return digest


def _machine(context: Context, digest: str, job_id: str) -> Machine:
    try:
        return Machine.from_document(json.loads(context.artifacts.get(digest)))
    except DocumentError as error:
        detail = f"job {job_id} has a machine that this version does not read: {error}"
        raise ProblemError(404, detail) from error


def _thumbnail(context: Context, job: Job, digest: str) -> bytes:
    kept = context.store.jobs.artifacts(job.id).get(THUMBNAIL)
    ended = job.state == JobState.DONE
    if kept is not None and ended:
        return context.artifacts.get(kept)
    task = context.tasks.exact(job.task, job.task_version)
    if task is None:
        raise ProblemError(404, f"task {job.task} is no longer at version {job.task_version}")
    try:
        drawn = still_png(_machine(context, digest, job.id), task.scenario)
    except MachineNotSimulable as error:
        raise ProblemError(404, f"job {job.id} has nothing to draw: {error}") from error
    if ended:
        _keep(context, job, drawn)
    return drawn


def _keep(context: Context, job: Job, drawn: bytes) -> None:
    made = {THUMBNAIL: context.artifacts.put(drawn, PNG)}
    with context.store.database.transaction() as connection:
        context.store.results.attach(job.id, made, connection=connection)
