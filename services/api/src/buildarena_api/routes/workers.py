"""Routes of workers: which processes do the jobs."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.pages import NEWEST_FIRST, Page, PagingDep, encode

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


@router.get("")
def list_workers(context: ContextDep, paging: PagingDep) -> Page[WorkerView]:
    """Lists the workers that reported within the last hour, the last started first."""
    found = context.store.workers.page(limit=paging.limit + 1, after=paging.after())
    shown, following = paging.cut(found, lambda one: encode(NEWEST_FIRST, one.started_at, one.id))
    return Page[WorkerView].model_validate({"data": shown, "next_cursor": following})
