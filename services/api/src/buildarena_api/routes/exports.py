"""Routes of exports: the leaderboard as CSV, Parquet and LaTeX, and a sweep's results."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from types import UnionType
from typing import Annotated, Any, Literal, get_args, get_origin

from fastapi import APIRouter, Query, Response

from buildarena_api.access import limited
from buildarena_api.dependencies import ServicesDep
from buildarena_api.http.pages import Page, PagingDep, seal
from buildarena_api.leaderboard.views import Board, BoardRow
from buildarena_api.routes.leaderboard import NO_BOARD, SelectionDep, board_answer
from buildarena_api.schemas import UsageView, View
from buildarena_backend.boards.ended_jobs import Round
from buildarena_backend.states import Outcome
from buildarena_benchmark import paper_tasks
from buildarena_benchmark.leaderboard import Board as RankedBoard
from buildarena_benchmark.leaderboard import (
    cost_table,
    performance_table,
    plain_table,
    published_rows,
)

router = APIRouter(prefix="/v1", tags=["leaderboard"], dependencies=[limited("heavy")])

MEDIA_TYPES = {
    "csv": "text/csv; charset=utf-8",
    "parquet": "application/vnd.apache.parquet",
    "latex": "text/x-tex; charset=utf-8",
}
PLACES = ("jobs",)
"""Fields of a row that are paths of this API: of no use in a file."""


class JobResult(View):
    """An ended job, with all data for reports."""

    job_id: str
    track: str
    task: str
    task_version: str
    model: str
    configuration: str
    decoding: dict[str, Any]
    seed: int
    outcome: Outcome
    reason: str | None
    success: float
    """Share of its worlds that its machine passed, 0 to 1."""
    indicator: float
    """Mean over its worlds, 0 where it failed."""
    parts: int | None
    flags: list[str]
    refusals: dict[str, int]
    usage: UsageView
    actions: int
    refused_actions: int
    ran_on_runner: bool
    """A runner ran one of its trials."""
    unverified: bool
    """True if it waits for its verification or was refuted: it does not count."""
    rounds: list[Round]
    """In order; more than one in a closed loop."""


@router.get(
    "/leaderboard/export",
    response_class=Response,
    responses={
        200: {"content": {kind.split(";")[0]: {} for kind in MEDIA_TYPES.values()}},
    },
)
def export(
    services: ServicesDep,
    selection: SelectionDep,
    *,
    format: Annotated[Literal["csv", "parquet", "latex"], Query()] = "csv",  # noqa: A002 - its name in the URL
) -> Response:
    """Return the leaderboard as a file; the LaTeX one has the paper's tables and ours."""

    def render(ranked: RankedBoard, board: Board) -> bytes:
        if format == "latex":
            return _latex(ranked, board.track).encode()
        return _csv(_flat(board)) if format == "csv" else _parquet(_flat(board))

    if selection.track is None:
        body = render(RankedBoard(tasks=(), overall=()), NO_BOARD)
    else:
        body = board_answer(services, selection, format, render).body
    name = f"leaderboard.{'tex' if format == 'latex' else format}"
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(body, media_type=MEDIA_TYPES[format], headers=headers)


@router.get("/sweeps/{sweep_id}/results", response_model=Page[JobResult])
def list_results(sweep_id: str, services: ServicesDep, paging: PagingDep) -> Response:
    """List the ended jobs of a sweep with their rounds, by id: the data of a report."""
    store = services.context.store
    store.sweeps.get(sweep_id)
    rows = store.results.boards.of_sweep(sweep_id, after=paging.text or "", limit=paging.limit + 1)
    shown, following = paging.cut(rows, lambda row: seal([row[0].job_id]))
    results = [
        JobResult.model_validate({**asdict(trial), "usage": trial, "rounds": rounds})
        for trial, rounds in shown
    ]
    page = Page[JobResult](data=results, next_cursor=following)
    return Response(page.model_dump_json(), media_type="application/json")


def _columns() -> list[str]:
    names = [name for name in BoardRow.model_fields if name not in PLACES]
    about = ("track", "task_version", "indicator", "unit", "rank", "rank_low", "rank_high")
    return list(dict.fromkeys(["task", "model", *about, *names]))


def _flat(board: Board) -> list[dict[str, Any]]:
    """Return a record for each row; mappings and lists as JSON texts, for every format."""
    records = []
    for task in board.tasks:
        head = {
            "track": board.track,
            "task": task.task,
            "task_version": task.version,
            "indicator": task.indicator,
            "unit": task.unit,
        }
        records += [
            {**head, **row.model_dump(mode="json", exclude=set(PLACES))} for row in task.rows
        ]
    return [{name: _plain(record.get(name)) for name in _columns()} for record in records]


def _plain(value: Any) -> Any:
    return json.dumps(value, sort_keys=True) if isinstance(value, dict | list) else value


def _csv(rows: Sequence[dict[str, Any]]) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, _columns(), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _parquet(rows: Sequence[dict[str, Any]]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([(name, types.get(_kind(name), pa.string())) for name in _columns()])
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), sink, compression="zstd")
    return sink.getvalue()


def _kind(name: str) -> type:
    """Return a column's type; text for everything that is not a plain number."""
    fields = BoardRow.model_fields
    annotation = fields[name].annotation if name in fields else str
    choices = get_args(annotation) if get_origin(annotation) is UnionType else (annotation,)
    return next((choice for choice in choices if choice in (int, float, bool)), str)


def _latex(ranked: RankedBoard, track: str | None) -> str:
    """Return our two tables and the paper's two; other tasks have separate tables."""
    cells = {board.task: [row.cell for row in board.rows] for board in ranked.tasks}
    ours = {task: row for task, row in cells.items() if task in paper_tasks()}
    own = {task: row for task, row in cells.items() if task not in ours}
    paper = {task: rows for task, rows in published_rows().items() if task in ours}
    extra = ["% Measured: tasks that the paper does not have", plain_table(own)] if own else []
    return "\n".join(
        [
            "% Needs the packages booktabs and multirow.",
            f"% Track: {track or 'none, as no job has ended'}",
            "% Measured: performance",
            performance_table(ours),
            "% Measured: cost",
            cost_table(ours),
            *extra,
            "% Published in the paper, measured in the game itself: performance",
            performance_table(paper),
            "% Published in the paper: cost",
            cost_table(paper),
        ]
    )
