"""Routes of how machines came about and look: replays, GLB files and thumbnails."""

from __future__ import annotations

from typing import Any, Final

from fastapi import APIRouter, Request, Response

from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.codes import ErrorCode
from buildarena_api.http.etags import conditional
from buildarena_api.http.problems import ProblemError
from buildarena_api.job_records import machine_hash, machine_of, task_of
from buildarena_api.replays.views import ReplayView
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState
from buildarena_geometry.export import machine_glb
from buildarena_simulation import MachineNotSimulable
from buildarena_simulation.render.still import still_png

router = APIRouter(prefix="/v1", tags=["pictures"])

GLB: Final = "model/gltf-binary"
PNG: Final = "image/png"
THUMBNAIL: Final = "thumbnail"
MAX_CACHED_PICTURES: Final = 64 << 20
"""Bytes of GLB files and pictures in memory."""


@router.get(
    "/jobs/{job_id}/machine.glb",
    response_class=Response,
    responses={200: {"content": {GLB: {}}}},
)
def machine_model(
    job_id: str, context: ContextDep, services: ServicesDep, request: Request
) -> Response:
    """The job's machine as a GLB file: a node for each part, named by its id."""
    job = context.store.jobs.get(job_id)
    digest = machine_hash(context, job)
    answer = services.pictures.get_or_make(
        f"glb {digest}", lambda: machine_glb(machine_of(context, digest, job))
    )
    return conditional(request, answer, GLB)


@router.get(
    "/jobs/{job_id}/thumbnail.png",
    response_class=Response,
    responses={200: {"content": {PNG: {}}}},
)
def thumbnail(
    job_id: str, context: ContextDep, services: ServicesDep, request: Request
) -> Response:
    """A picture of the job's machine where its trial puts it, 480 x 320 pixels.

    It is drawn when it is first asked for; that of an ended job is then one of its artifacts.
    """
    job = context.store.jobs.get(job_id)
    digest = machine_hash(context, job)
    answer = services.pictures.get_or_make(
        f"png {digest} {job.task} {job.task_version} {job.state}",
        lambda: _thumbnail(context, job, digest),
    )
    return conditional(request, answer, PNG)


def _thumbnail(context: Context, job: Job, digest: str) -> bytes:
    kept = context.store.jobs.artifacts(job.id).get(THUMBNAIL)
    ended = job.state == JobState.DONE
    if kept is not None and ended:
        return context.artifacts.get(kept)
    try:
        drawn = still_png(machine_of(context, digest, job), task_of(context, job).scenario)
    except MachineNotSimulable as error:
        detail = f"job {job.id} has nothing to draw: {error}"
        raise ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, detail) from error
    if ended:
        _keep(context, job, drawn)
    return drawn


def _keep(context: Context, job: Job, drawn: bytes) -> None:
    made = {THUMBNAIL: context.artifacts.put(drawn, PNG)}
    with context.store.database.transaction() as connection:
        context.store.results.attach(job.id, made, connection=connection)


@router.get("/jobs/{job_id}/replay", response_model=ReplayView)
def show_replay(job_id: str, services: ServicesDep, request: Request) -> Any:
    """How the job's machine came about: every action with what it changed, or why it was refused.

    It is the geometry library's own account: the kept actions are done again. Of a session in
    several rounds it tells the last. While a session is under way it goes as far as that has come.
    """
    answer = services.replays.answer(services.context.store.jobs.get(job_id))
    return conditional(request, answer, "application/json")
