"""Health: what works, what does not, and what to do about it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.probes import PartFailedError, Probes
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.simulators.known import configured_simulators
from buildarena_store import SchemaVersionError, WorkerCounts
from buildarena_store.states import CONSTRUCT_QUEUE, simulate_queue

# No turn is waited for: an answer takes neither a thread nor a connection.
router = APIRouter(prefix="/v1", tags=["health"])

LOW_DISK_BYTES = 1_000_000_000
CLOCK_TOLERANCE_S = 5.0


class Check(BaseModel):
    """One part of the service."""

    name: str = Field(examples=["database"])
    ok: bool
    detail: str
    advice: str = Field(default="", description="What to do when it is not ok")


class Health(BaseModel):
    """The service as a whole."""

    status: Literal["ok", "degraded", "down"]
    checks: list[Check]


@router.get(
    "/health",
    responses={503: {"model": Health, "description": "down"}},
)
async def health(context: ContextDep, request: Request, response: Response) -> Health:
    """Says how database, broker, artifacts, workers and disk are, as they were last asked.

    Answers at once, also while one of them accepts connections and does not answer, and 503 when
    jobs can't be accepted.
    """
    probes: Probes = request.app.state.probes
    await probes.renew(probes.database, probes.broker, probes.artifacts)
    database, counts = _database(probes)
    checks = [database, _broker(probes), _artifacts(probes), _disk(context)]
    if counts is None:
        response.status_code = 503
        return Health(status="down", checks=checks)
    checks += [*_workers(context, counts), _clocks(counts)]
    return Health(status="ok" if all(c.ok for c in checks) else "degraded", checks=checks)


def _database(probes: Probes) -> tuple[Check, WorkerCounts | None]:
    try:
        counts = probes.database.latest()
    except PartFailedError as error:
        advice = "start Postgres, or correct BUILDARENA_DATABASE_URL"
        if isinstance(error.__cause__, SchemaVersionError):
            advice = "run `buildarena migrate`"
        elif error.is_silent:
            advice = "look at Postgres' log, disk and locks; it accepts connections"
        return Check(name="database", ok=False, detail=str(error), advice=advice), None
    return Check(name="database", ok=True, detail="reachable, schema as expected"), counts


def _broker(probes: Probes) -> Check:
    try:
        waiting = probes.broker.latest()
    except PartFailedError as error:
        return Check(
            name="broker",
            ok=False,
            detail=f"{error}; jobs are kept and wait",
            advice="start Valkey or Redis, or correct BUILDARENA_BROKER_URL",
        )
    return Check(name="broker", ok=True, detail=f"reachable, {waiting} messages for construct")


def _artifacts(probes: Probes) -> Check:
    try:
        probes.artifacts.latest()
    except PartFailedError as error:
        return Check(
            name="artifacts",
            ok=False,
            detail=f"{error}; jobs wait and lose nothing",
            advice="free space, or correct BUILDARENA_ARTIFACTS_URL and its permissions",
        )
    return Check(name="artifacts", ok=True, detail="can be written and read")


def _workers(context: Context, counts: WorkerCounts) -> list[Check]:
    checks = []
    simulators = configured_simulators(context.settings)
    for queue in [CONSTRUCT_QUEUE, *map(simulate_queue, simulators)]:
        serving = counts.serving.get(queue, 0)
        checks.append(
            Check(
                name=f"workers of {queue}",
                ok=serving > 0,
                detail=f"{serving} alive",
                advice="" if serving else f"start a worker for the queue {queue}",
            )
        )
    return checks


def _clocks(counts: WorkerCounts) -> Check:
    """Leases go by the database's clock; but limits in seconds and logs go by each process' own."""
    wrong = [
        f"{worker} is {abs(ahead_s):.0f} s {'ahead' if ahead_s > 0 else 'behind'}"
        for worker, ahead_s in counts.clocks
        if abs(ahead_s) > CLOCK_TOLERANCE_S
    ]
    return Check(
        name="clocks",
        ok=not wrong,
        detail="; ".join(wrong) or "workers and database agree",
        advice="synchronise these machines' clocks by NTP" if wrong else "",
    )


def _disk(context: Context) -> Check:
    folder = context.settings.artifact_folder
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    free = shutil.disk_usage(Path(existing)).free
    return Check(
        name="disk",
        ok=free > LOW_DISK_BYTES,
        detail=f"{free / 1e9:.1f} GB free",
        advice="" if free > LOW_DISK_BYTES else f"free some space under {existing}",
    )
