"""Health: the service's faults with remedies; and metrics, for Prometheus."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ServicesDep
from buildarena_api.http.parts import PartFailedError, Parts
from buildarena_backend.errors import SchemaVersionError
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE, Audit, SweepState, simulate_queue
from buildarena_backend.telemetry.metrics import MetricValues
from buildarena_backend.trials.known_simulators import configured_simulators
from buildarena_backend.workers import WorkerCounts

# Without a wait for a turn: an answer takes neither a thread nor a connection.
router = APIRouter(prefix="/v1", tags=["health"])
metrics = APIRouter(prefix="/v1", tags=["health"])

# Wrong is what deploy/monitoring/prometheus/alerts.yml calls wrong; a test compares them.
LOW_DISK_BYTES: Final = 1_000_000_000
LOW_DISK_SHARE: Final = 0.1
LONG_WAIT_S: Final = 3600.0
FEW_LOST: Final = 3
CLOCK_TOLERANCE_S: Final = 5.0


class HealthCheck(BaseModel):
    """A part of the service."""

    name: str = Field(examples=["database"])
    ok: bool
    detail: str
    advice: str = Field(default="", description="What to do when it is not ok")


class Health(BaseModel):
    """The service as a whole."""

    status: Literal["ok", "degraded", "down"]
    checks: list[HealthCheck]


@router.get("/health", responses={503: {"model": Health, "description": "down"}})
async def health(services: ServicesDep, response: Response) -> Health:
    """Return the last verdicts on database, broker, artifacts, workers and disk.

    Answers at once, also while one of them accepts connections and does not answer, and 503 when
    jobs can't be accepted.
    """
    context, parts = services.context, services.parts
    await parts.renew()
    database, counts = _database(parts)
    checks = [database, _broker(parts), _artifacts(parts), _disk(context)]
    if counts is None:
        response.status_code = 503
        return Health(status="down", checks=checks)
    read = parts.figures.verdict
    figures = None if isinstance(read, PartFailedError) else read
    checks += [*_workers(context, counts, figures), _lost(counts), _clocks(counts)]
    if figures is not None:
        checks += [_waiting(figures), _audits(figures), _budgets(figures)]
    return Health(status="ok" if all(c.ok for c in checks) else "degraded", checks=checks)


def _check(name: str, detail: str, advice: str = "") -> HealthCheck:
    """Return a check, with advice if it is not ok."""
    return HealthCheck(name=name, ok=not advice, detail=detail, advice=advice)


def _database(parts: Parts) -> tuple[HealthCheck, WorkerCounts | None]:
    counts = parts.database.verdict
    if isinstance(counts, PartFailedError):
        advice = "start Postgres, or correct BUILDARENA_DATABASE_URL"
        if isinstance(counts.__cause__, SchemaVersionError):
            advice = "run `buildarena admin migrate`"
        elif counts.is_silent:
            advice = "look at Postgres' log, disk and locks; it accepts connections"
        return _check("database", str(counts), advice), None
    return _check("database", "reachable, schema as expected"), counts


def _broker(parts: Parts) -> HealthCheck:
    waiting = parts.broker.verdict
    if isinstance(waiting, PartFailedError):
        advice = "start Valkey or Redis, or correct BUILDARENA_BROKER_URL"
        return _check("broker", f"{waiting}; jobs are kept and wait", advice)
    return _check("broker", f"reachable, {waiting} messages for construct")


def _artifacts(parts: Parts) -> HealthCheck:
    failure = parts.artifacts.verdict
    if isinstance(failure, PartFailedError):
        advice = "free space, or correct BUILDARENA_ARTIFACTS_URL and its permissions"
        return _check("artifacts", f"{failure}; jobs wait and lose nothing", advice)
    return _check("artifacts", "can be written and read")


def _workers(
    context: Context, counts: WorkerCounts, figures: MetricValues | None
) -> Iterator[HealthCheck]:
    """Each queue that has workers or should have: those of our simulators, and where jobs wait."""
    waiting = {each.queue: each for each in figures.queues if each.jobs} if figures else {}
    ours = [CONSTRUCT_QUEUE, *map(simulate_queue, configured_simulators(context.settings))]
    for queue in dict.fromkeys([*ours, *sorted({*counts.serving, *waiting})]):
        serving, depth = counts.serving.get(queue, 0), waiting.get(queue)
        detail = f"{serving} alive" + (f"; {depth.jobs} waiting" if depth else "")
        advice = "" if serving else f"start a worker for the queue {queue}"
        yield _check(f"workers of {queue}", detail, advice)


def _waiting(figures: MetricValues) -> HealthCheck:
    oldest = max(figures.queues, key=lambda depth: depth.oldest_s, default=None)
    if oldest is None or oldest.oldest_s < 1:
        return _check("waiting", "no job")
    is_long = oldest.oldest_s > LONG_WAIT_S
    advice = f"start more workers for the queue {oldest.queue}" if is_long else ""
    detail = f"the oldest job for {_duration(oldest.oldest_s)}, in {oldest.queue}"
    return _check("waiting", detail, advice)


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes else f"{seconds:.0f} s"


def _lost(counts: WorkerCounts) -> HealthCheck:
    many = max(counts.lost.values(), default=0) > FEW_LOST
    lost = [f"{number} of {kind}" for kind, number in sorted(counts.lost.items()) if number]
    advice = "see why they ended: memory, machines, too short a time to stop" if many else ""
    return _check("silent workers", f"{', '.join(lost) or 'none'} within the last hour", advice)


def _audits(figures: MetricValues) -> HealthCheck:
    waiting = figures.audits.get(Audit.REQUIRED, 0)
    return _check("audits", f"{waiting} jobs wait for their verification")


def _budgets(figures: MetricValues) -> HealthCheck:
    """Return the check of used-up budgets: not a fault, but jobs wait for a decision."""
    waiting = figures.sweeps.get(SweepState.BUDGET_EXHAUSTED, 0)
    advice = "see `buildarena sweep list`, then resume or cancel them" if waiting else ""
    detail = f"{waiting} sweeps wait for a larger one"
    return HealthCheck(name="budgets", ok=True, detail=detail, advice=advice)


def _clocks(counts: WorkerCounts) -> HealthCheck:
    """Compare clocks: leases use the database's, limits in seconds and logs each process' own."""
    wrong = [
        f"{worker} is {abs(ahead_s):.0f} s {'ahead' if ahead_s > 0 else 'behind'}"
        for worker, ahead_s in counts.clocks
        if abs(ahead_s) > CLOCK_TOLERANCE_S
    ]
    advice = "synchronise these machines' clocks by NTP" if wrong else ""
    return _check("clocks", "; ".join(wrong) or "workers and database agree", advice)


def _disk(context: Context) -> HealthCheck:
    folder = context.settings.artifact_folder
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    disk = shutil.disk_usage(Path(existing))
    share = disk.free / disk.total
    is_low = disk.free < LOW_DISK_BYTES or share < LOW_DISK_SHARE
    advice = f"free some space under {existing}" if is_low else ""
    return _check("disk", f"{disk.free / 1e9:.1f} GB free, {share:.0%}", advice)


@metrics.get(
    "/metrics",
    response_class=Response,
    # Only a key from the database needs a look-up there.
    responses={200: {"content": {"text/plain": {}}}},
)
async def show_metrics(services: ServicesDep) -> Response:
    """Return the figures for Prometheus: jobs, queues, stage times, tokens, cost, errors, requests.

    Answers at once: what a part of the service does not answer is left out, and its `_up` is 0.
    """
    await services.parts.renew()
    return Response(generate_latest(services.metrics.registry), media_type=CONTENT_TYPE_LATEST)
