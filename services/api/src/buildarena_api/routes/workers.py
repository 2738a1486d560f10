"""Routes of workers: which processes do the jobs."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.dependencies import MAX_ROWS, ContextDep
from buildarena_api.http import cursors
from buildarena_api.http.problems import problem_responses

router = APIRouter(prefix="/v1/workers", tags=["workers"])


class WorkerView(BaseModel):
    """A process that works on jobs."""

    model_config = ConfigDict(from_attributes=True)

    id: str = Field(
        description="KIND@HOST:PID beside the database, runner@KEY/NAME where it reaches only the "
        "API",
        examples=["simulate@lab3:4711-9f2c41", "runner@key_0a1b2c3d4e5f60718293/lab4-4711"],
    )
    kind: str = Field(examples=["simulate"])
    queues: list[str] = Field(examples=[["simulate.mujoco"]])
    host: str
    pid: int
    versions: dict[str, Any]
    started_at: datetime
    seen_at: datetime
    alive: bool = Field(description="Whether it reported within the last 15 seconds")
    peak_memory_bytes: int | None
    clock_ahead_s: float | None = Field(description="How far its clock is ahead of the database's")


class WorkerPage(BaseModel):
    """Some workers, the last started first."""

    workers: list[WorkerView]
    next_cursor: str | None = Field(description="Give it as `cursor` to get the next page")


@router.get("", responses=problem_responses(422, 503))
def list_workers(
    context: ContextDep,
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS)] = 100,
    cursor: str | None = None,
) -> WorkerPage:
    """Lists the workers that reported within the last hour, the last started first."""
    after = None if cursor is None else cursors.decode(cursor)
    page = context.store.workers.page(limit=limit + 1, after=after)
    shown, more = page[:limit], len(page) > limit
    return WorkerPage(
        workers=[WorkerView.model_validate(worker) for worker in shown],
        next_cursor=cursors.encode(shown[-1].started_at, shown[-1].id) if more else None,
    )
