"""Health: what works, what does not, and what to do about it."""

from __future__ import annotations

import shutil
import threading
import time
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel, Field
from sqlalchemy.exc import SQLAlchemyError

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.concurrency import anybodys_turn
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.simulators.known import configured_simulators
from buildarena_store import ArtifactStore, ArtifactStoreError, WorkerCounts
from buildarena_store.states import CONSTRUCT_QUEUE, simulate_queue

router = APIRouter(
    prefix="/v1", tags=["health"], dependencies=[Depends(anybodys_turn, scope="function")]
)

LOW_DISK_BYTES = 1_000_000_000
CLOCK_TOLERANCE_S = 5.0
PROBE_EVERY_S = 5.0


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
def health(context: ContextDep, request: Request, response: Response) -> Health:
    """Checks database, broker, artifacts, workers and disk.

    Answers 503 when jobs can't be accepted.
    """
    database = _database(context)
    artifacts: ArtifactProbe = request.app.state.artifact_probe
    checks = [database, _broker(context), artifacts.check(), _disk(context)]
    if database.ok:
        counts = context.store.workers.counts()
        checks += [*_workers(context, counts), _clocks(counts)]
    if not database.ok:
        response.status_code = 503
        return Health(status="down", checks=checks)
    return Health(status="ok" if all(c.ok for c in checks) else "degraded", checks=checks)


class ArtifactProbe:
    """Tries the artifact store, at most every few seconds, however often health is asked for.

    Args:
        store: What artifacts are kept in.
    """

    def __init__(self, store: ArtifactStore) -> None:
        self._store = store
        self._lock = threading.Lock()
        self._check: Check | None = None
        self._tried_at = 0.0

    def check(self) -> Check:
        """Whether artifacts can be written and read, as last tried."""
        with self._lock:
            if self._check is None or time.monotonic() - self._tried_at > PROBE_EVERY_S:
                self._check, self._tried_at = self._try(), time.monotonic()
            return self._check

    def _try(self) -> Check:
        try:
            self._store.probe()
        except ArtifactStoreError as error:
            return Check(
                name="artifacts",
                ok=False,
                detail=f"{error}; jobs wait and lose nothing",
                advice="free space, or correct BUILDARENA_ARTIFACTS and its permissions",
            )
        return Check(name="artifacts", ok=True, detail="can be written and read")


def _database(context: Context) -> Check:
    try:
        context.store.database.require_schema()
    except SQLAlchemyError as error:
        return Check(
            name="database",
            ok=False,
            detail=str(error).splitlines()[0],
            advice="start Postgres, or correct BUILDARENA_DATABASE_URL",
        )
    except Exception as error:  # noqa: BLE001 - health reports whatever is wrong
        return Check(
            name="database", ok=False, detail=str(error), advice="run `buildarena migrate`"
        )
    return Check(name="database", ok=True, detail="reachable, schema as expected")


def _broker(context: Context) -> Check:
    waiting = context.queues.waiting(CONSTRUCT_QUEUE)
    if waiting is None:
        return Check(
            name="broker",
            ok=False,
            detail="not reachable; jobs are kept and wait",
            advice="start Valkey or Redis, or correct BUILDARENA_BROKER_URL",
        )
    return Check(name="broker", ok=True, detail=f"reachable, {waiting} messages for construct")


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
