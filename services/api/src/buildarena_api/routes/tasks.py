"""Routes of tasks: the built-in ones, and those that users upload."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import AliasPath, BeforeValidator, Field

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import ContextDep, RequestKey
from buildarena_api.http.bodies import YAML, is_yaml, not_utf8
from buildarena_api.http.etags import Answer, conditional
from buildarena_api.http.pages import Page, PagingDep
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_api.schemas import EXISTED, View, tell_created
from buildarena_backend.database.text import clean
from buildarena_benchmark import Task, parse_custom_task
from buildarena_benchmark.categories import title_of
from buildarena_benchmark.tasks.sources import MAX_BYTES

PATH = "/v1/tasks"
router = APIRouter(prefix=PATH, tags=["tasks"], dependencies=[limited()])

JSON = "application/json"
EXAMPLE = """\
name: narrow-gap
title: A bridge over a gap of 3
category: support
statement: |
  Build a bridge over a gap that is 3 units wide, and that carries a cargo of 200.
scenario:
  duration_s: 12
  terrain:
    - {center: [0, -11.5, 2.5], size: [30, 20, 5]}
    - {center: [0, 11.5, 2.5], size: [30, 20, 5]}
  cargo: {size: [2, 2, 1], final_mass: 200, ramp_s: 10}
  placement: {kind: span, gap: 3}
scoring: {name: support}
indicator: {name: load, unit: mass units}
"""


def _of_task(*path: str, examples: list[str] | None = None) -> Any:
    """Return a field that a catalogue's entry has in its task."""
    return Field(validation_alias=AliasPath("task", *path), examples=examples)


class TaskView(View):
    """A task that jobs can name."""

    name: str = _of_task("name", examples=["support-1"])
    version: str = _of_task("version")
    """Content hash of all that can change a score."""
    title: str = _of_task("title")
    category: str = _of_task("category")
    category_title: Annotated[str, BeforeValidator(title_of)] = _of_task(
        "category", examples=["Bridges"]
    )
    """Title of the category."""
    level: int = _of_task("level")
    statement: str = _of_task("statement")
    """Statement for the model."""
    indicator: str = _of_task("indicator", "name", examples=["load"])
    """Name of the figure it is ranked by."""
    unit: str = _of_task("indicator", "unit", examples=["mass units"])
    """The figure's unit; "1" for a ratio."""
    ceiling: float | None = _of_task("ceiling")
    """The greatest possible indicator; null where only the machine bounds it."""
    custom: bool
    """Whether it was uploaded."""
    created_at: datetime | None
    """Time of this version's upload; null for built-in ones."""


class TaskDetail(TaskView):
    """A version of a task with its whole document."""

    current: bool
    """Whether new submissions get this version."""
    document: Annotated[dict[str, Any], BeforeValidator(Task.as_document)] = _of_task()
    """The whole document, defaults included; JSON is YAML, so it can be uploaded."""


async def _text(request: Request) -> str:
    """Return the request's body, if it is YAML or JSON, which is YAML, of an acceptable size."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type != JSON and not is_yaml(request.headers):
        message = f"the body's type is {media_type or 'not named'}; send {YAML} or {JSON}"
        headers = {"Accept-Post": f"{YAML}, {JSON}"}
        raise ProblemError(ErrorCode.UNSUPPORTED_MEDIA_TYPE, message, headers=headers)
    body = await request.body()
    if len(body) > MAX_BYTES:
        detail = f"a task has at most {MAX_BYTES:,} bytes, this {len(body):,}"
        raise ProblemError(ErrorCode.TOO_LARGE, detail)
    try:
        return body.decode()
    except UnicodeDecodeError as error:
        raise not_utf8(body, error) from error


@router.post(
    "",
    status_code=201,
    responses=EXISTED,
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                YAML: {
                    "schema": {"type": "string", "maxLength": MAX_BYTES},
                    "examples": {"bridge": {"summary": "A narrow gap", "value": EXAMPLE}},
                },
                JSON: {"schema": {"type": "object"}},
            },
        }
    },
)
def add_task(
    text: Annotated[str, Depends(_text)],
    response: Response,
    context: ContextDep,
    caller: CallerDep,
    _: RequestKey,
) -> TaskDetail:
    """Upload a task, or a new version of one of your own; new submissions get it from then on."""
    catalogue = context.tasks
    task = parse_custom_task(text, origin="task")
    document = dict(task.as_document())
    if clean(document) != document:
        detail = "a text has NUL or half a character, which can't be stored"
        raise ProblemError(ErrorCode.INVALID_FIELD, detail)
    added = catalogue.add(task, text, owner=caller.key_id, force=caller.is_admin)
    tell_created(response, f"/v1/tasks/{task.name}?version={task.version}", is_new=added)
    return TaskDetail.model_validate(catalogue.find(task.name, task.version))


@router.get("", response_model=Page[TaskView])
def list_tasks(context: ContextDep, request: Request, paging: PagingDep) -> Any:
    """List the tasks in their newest versions, the built-in ones first."""
    page = Page[TaskView].model_validate(paging.of(context.tasks.entries()))
    return conditional(request, Answer.of(page.model_dump_json().encode()), JSON)


@router.get("/{task}", response_model=TaskDetail)
def show_task(
    task: Annotated[str, Path(max_length=60, pattern=r"^[a-z0-9-]+$")],
    context: ContextDep,
    request: Request,
    version: Annotated[
        str | None, Query(pattern="^[0-9a-f]{12}$", description="Default: the newest")
    ] = None,
) -> Any:
    """Show a task with its whole document."""
    view = TaskDetail.model_validate(context.tasks.find(task, version))
    return conditional(request, Answer.of(view.model_dump_json().encode()), JSON)
