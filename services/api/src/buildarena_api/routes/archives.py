"""Routes of archives: exporting and importing a whole sweep as one file."""

from __future__ import annotations

import tempfile
from pathlib import Path

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

from buildarena_api.dependencies import ExportingDep
from buildarena_api.http.access import CallerDep, admin_only
from buildarena_api.http.concurrency import limited
from buildarena_api.http.own_pool import OwnPool
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_store.archives import ArchiveError, read_archive, write_archive

router = APIRouter(
    prefix="/v1", tags=["archives"], dependencies=[limited("archives", until="request")]
)

IMPORT_PATH = "/v1/archives"
MAX_BYTES = 8 << 30
"""Largest archive imported: the paper's whole matrix has about 3 GB of trajectories."""
ZIP = "application/zip"


class ImportedView(BaseModel):
    """The result of an import."""

    model_config = ConfigDict(from_attributes=True)

    sweep_id: str
    jobs: int = Field(description="Jobs it consists of")
    added: int = Field(description="Jobs that were not there before")
    unverified: int = Field(
        description="Scores among them: they count when their verification, which was requested, "
        "has found them again"
    )


@router.get(
    "/sweeps/{sweep_id}/archive",
    response_class=FileResponse,
    responses={200: {"content": {ZIP: {}}}, **problem_responses(404, 503)},
)
async def export_sweep(sweep_id: str, exporting: ExportingDep) -> FileResponse:
    """A sweep with its jobs, journals, rollouts and artifacts, as one ZIP file."""
    context = exporting.context
    target = _scratch()
    try:
        await exporting.run(
            write_archive, context.store.database, context.artifacts, sweep_id, target
        )
    except BaseException:
        target.unlink()
        raise
    return FileResponse(
        target,
        media_type=ZIP,
        filename=f"{sweep_id}.zip",
        background=BackgroundTask(target.unlink),
    )


@router.post(
    "/archives",
    status_code=201,
    dependencies=[Depends(admin_only)],
    responses=problem_responses(413, 422, 503),
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def import_sweep(
    request: Request, response: Response, exporting: ExportingDep, caller: CallerDep
) -> ImportedView:
    """Imports an exported sweep; jobs that already exist stay as they are. For admins.

    Nothing in it is believed: its scores are marked as imported, and are in no ranking until they
    were found again by replay and simulation.
    """
    context = exporting.context
    source = _scratch()
    try:
        await _receive(request, source, exporting)
        done = await exporting.run(
            read_archive,
            context.store.database,
            context.artifacts,
            source,
            check_spec=SweepSpec.model_validate,
            owner=caller.key_id,
        )
    except ArchiveError as error:
        raise ProblemError(422, str(error)) from error
    finally:
        source.unlink()
    response.headers["Location"] = f"/v1/sweeps/{done.sweep_id}"
    return ImportedView.model_validate(done)


async def _receive(request: Request, target: Path, exporting: OwnPool) -> None:
    received = 0
    with target.open("wb") as file:
        async for chunk in request.stream():
            received += len(chunk)
            if received > MAX_BYTES:
                raise ProblemError(413, f"the archive is larger than {MAX_BYTES:,} bytes")
            await exporting.run(file.write, chunk)


def _scratch() -> Path:
    with tempfile.NamedTemporaryFile(prefix="buildarena-", suffix=".zip", delete=False) as file:
        return Path(file.name)
