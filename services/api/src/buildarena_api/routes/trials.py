"""Routes of trials and of pictures: trajectories, scenes, GLB files, thumbnails and replays."""

from __future__ import annotations

from threading import Lock
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request, Response

from buildarena_api.access import limited
from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.etags import conditional
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_api.job_records import machine_hash, machine_of, no_artifact, require_ended, task_of
from buildarena_api.replays import ReplayView
from buildarena_api.scenes import SceneView, machine_scene
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.states import JobState
from buildarena_geometry.export import machine_glb
from buildarena_simulation import MachineNotSimulable, TrajectoryFormatError
from buildarena_simulation.arrow import MEDIA_TYPE as ARROW
from buildarena_simulation.arrow import arrow_stream, unpacked_bytes
from buildarena_simulation.render.still import still_png

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])
pictures = APIRouter(prefix="/v1/jobs", tags=["pictures"], dependencies=[limited("heavy")])

GLB: Final = "model/gltf-binary"
PNG: Final = "image/png"
THUMBNAIL: Final = "thumbnail"
PARQUET: Final = "application/vnd.apache.parquet"
MAX_ARROW_BYTES: Final = 64 << 20
"""Larger trajectories are given only as the file that is kept: they fill a page's memory."""
Number = Annotated[int, Query(ge=0, le=1000, description="Which rollout's")]
_unpacking = Lock()


@router.get(
    "/{job_id}/trajectory",
    dependencies=[limited("trajectories", until="request")],
    responses={
        200: {"content": {PARQUET: {}, ARROW: {}}, "description": "As Parquet, or Arrow IPC"},
    },
    response_class=Response,
)
def get_trajectory(
    job_id: str, context: ContextDep, request: Request, number: Number = 0
) -> Response:
    """Return a trajectory of a job, as the Parquet file that is kept, or as an Arrow IPC stream.

    `Accept: application/vnd.apache.arrow.stream` asks for the stream: one record batch with
    `time_s`, and lists of fixed size, block after block: `positions` (the shown centres, units),
    `quaternions` (w, x, y, z), `cargo_position`, `cargo_quaternion`, `cargo_mass`, `heated`,
    `pieces`, the `bearing` forces, and `joint_loads`: the largest share of its strength that each
    joint bore since the instant before, in the order of the joint peaks (not in trajectories of
    before schema 3). Of a trial with a program there are `senses` and `answers` too. Block and
    cannon ids, joint peaks, breaks, `sense_names` and `action_names` are JSON in the schema's
    metadata under `buildarena.trajectory`.
    """
    require_ended(context, context.store.jobs.get(job_id))
    digest = context.store.jobs.artifacts(job_id).get(f"trajectory-{number}")
    if digest is None:
        raise no_artifact(job_id, f"trajectory-{number}")
    as_arrow = ARROW in request.headers.get("accept", "").lower()
    media_type = ARROW if as_arrow else PARQUET
    headers = {"ETag": f'"{digest}{"-arrow" if as_arrow else ""}"', "Vary": "Accept"}
    if headers["ETag"] in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    data = context.artifacts.get(digest)
    return Response(
        _arrow(data, job_id) if as_arrow else data, media_type=media_type, headers=headers
    )


@router.get("/{job_id}/scene", response_model=SceneView, dependencies=[limited("heavy")])
def show_scene(job_id: str, services: ServicesDep, request: Request, number: Number = 0) -> Any:
    """Return all data to draw a trial: the scenario, the machine's parts and their bodies.

    With a trajectory's poses it makes a film: a block's root point lies at
    `position - rotation * center`, and its bodies are given in the block's own frame.
    """
    context = services.context
    job = context.store.jobs.get(job_id)
    digest, seed = _trial_inputs(context, job, number)
    answer = services.pictures.get_or_make(
        f"scene {digest} {seed} {job.task} {job.task_version}",
        lambda: _scene(context, job, digest, seed),
    )
    return conditional(request, answer, "application/json")


def _trial_inputs(context: Context, job: Job, number: int) -> tuple[str | None, int | None]:
    """Return a rollout's machine and seed; before the first, the machine that was built so far."""
    for record in context.store.rollouts.read(job.id):
        if record.number == number:
            return record.machine_hash, record.seed
    if number:
        raise no_artifact(job.id, f"rollout {number}")
    return context.store.jobs.artifacts(job.id).get("machine"), None


def _arrow(data: bytes, job_id: str) -> bytes:
    try:
        size = unpacked_bytes(data)
        if size > MAX_ARROW_BYTES:
            raise ProblemError(
                ErrorCode.TOO_LARGE,
                f"the trajectory of job {job_id} has {size:,} bytes unpacked, more than the "
                f"{MAX_ARROW_BYTES:,} that are sent as Arrow: ask for {PARQUET}",
            )
        # One at a time: unpacked it is several times in memory.
        with _unpacking:
            return arrow_stream(data)
    except TrajectoryFormatError as error:
        detail = f"job {job_id} has no trajectory that can be read: {error}"
        raise ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, detail) from error


def _scene(context: Context, job: Job, digest: str | None, seed: int | None) -> bytes:
    machine = None if digest is None else machine_scene(machine_of(context, digest, job))
    world = task_of(context, job).scenario.world(seed).model_dump(mode="json")
    return SceneView(scenario=world, machine=machine).model_dump_json().encode()


@pictures.get(
    "/{job_id}/machine.glb",
    response_class=Response,
    responses={200: {"content": {GLB: {}}}},
)
def machine_model(job_id: str, services: ServicesDep, request: Request) -> Response:
    """Return the job's machine as a GLB file: a node for each part, named by its id."""
    context = services.context
    job = context.store.jobs.get(job_id)
    digest = machine_hash(context, job)
    answer = services.pictures.get_or_make(
        f"glb {digest}", lambda: machine_glb(machine_of(context, digest, job))
    )
    return conditional(request, answer, GLB)


@pictures.get(
    "/{job_id}/thumbnail.png",
    response_class=Response,
    responses={200: {"content": {PNG: {}}}},
)
def thumbnail(job_id: str, services: ServicesDep, request: Request) -> Response:
    """Return a picture of the job's machine where its trial puts it, 480 x 320 pixels.

    It is drawn at the first request; that of an ended job is then one of its artifacts.
    """
    context = services.context
    job = context.store.jobs.get(job_id)
    digest = machine_hash(context, job)
    answer = services.pictures.get_or_make(
        f"png {digest} {job.task} {job.task_version} {job.state}",
        lambda: _thumbnail(context, job, digest),
    )
    return conditional(request, answer, PNG)


def _thumbnail(context: Context, job: Job, digest: str) -> bytes:
    stored = context.store.jobs.artifacts(job.id).get(THUMBNAIL)
    ended = job.state == JobState.DONE
    if stored is not None and ended:
        return context.artifacts.get(stored)
    try:
        drawn = still_png(machine_of(context, digest, job), task_of(context, job).scenario)
    except MachineNotSimulable as error:
        detail = f"job {job.id} has nothing to draw: {error}"
        raise ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, detail) from error
    if ended:
        artifacts = {THUMBNAIL: context.artifacts.put(drawn, PNG)}
        with context.store.database.transaction() as connection:
            context.store.results.attach(job.id, artifacts, connection=connection)
    return drawn


@pictures.get("/{job_id}/replay", response_model=ReplayView)
def show_replay(job_id: str, services: ServicesDep, request: Request) -> Any:
    """Return the machine's construction: every action with its changes or its refusal.

    The geometry library repeats the stored actions. Of a session in several rounds it contains the
    last. While a session is under way it ends with the last action so far.
    """
    answer = services.replays.answer(services.context.store.jobs.get(job_id))
    return conditional(request, answer, "application/json")
