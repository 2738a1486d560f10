"""Routes of tasks: the built-in ones, and those that users upload."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field, TypeAdapter

from buildarena_api.access import CallerDep
from buildarena_api.dependencies import ContextDep
from buildarena_api.http.etags import Answer, conditional
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_backend.catalog.tasks import CatalogueEntry, TaskChangedError
from buildarena_benchmark import TaskError, ValidationIssue, parse_custom_task
from buildarena_benchmark.tasks.sources import MAX_BYTES

PATH = "/v1/tasks"
router = APIRouter(prefix=PATH, tags=["tasks"])

YAML = "application/yaml"
YAML_TYPES = frozenset({YAML, "application/x-yaml", "text/yaml", "text/x-yaml"})
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


class TaskView(BaseModel):
    """A task that jobs can name."""

    name: str = Field(examples=["support-1"])
    version: str = Field(description="Content hash of all that can change a score")
    title: str
    category: str
    level: int
    statement: str = Field(description="What the model reads")
    indicator: str = Field(description="Name of the figure it is ranked by", examples=["load"])
    unit: str = Field(description='The figure\'s unit; "1" for a ratio', examples=["mass units"])
    ceiling: float | None = Field(
        description="The greatest indicator there is; null where only what can be built bounds it"
    )
    difficulty: dict[str, int] = Field(description="Weight of each difficulty dimension, if any")
    custom: bool = Field(description="Whether somebody uploaded it")
    created_at: datetime | None = Field(description="When this version was; null for built-in ones")


class TaskDetail(TaskView):
    """A version of a task with its whole document."""

    current: bool = Field(description="Whether new submissions get this version")
    document: dict[str, Any] = Field(
        description="The whole document, defaults included; JSON is YAML, so it can be uploaded"
    )


_LIST = TypeAdapter(list[TaskView])


async def _yaml_text(request: Request) -> str:
    """The request's body, as long as it is YAML of an acceptable size."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type not in YAML_TYPES:
        message = f"the body's type is {media_type or 'not named'}; send {YAML}"
        raise ProblemError(415, message, headers={"Accept-Post": YAML})
    body = await request.body()
    if len(body) > MAX_BYTES:
        raise ProblemError(413, f"a task has at most {MAX_BYTES:,} bytes, this {len(body):,}")
    try:
        return body.decode()
    except UnicodeDecodeError as error:
        line = body.count(b"\n", 0, error.start) + 1
        message = "the text is not UTF-8"
        problem = ValidationIssue(path="", message=message, line=line)
        raise ProblemError(422, f"line {line}: {message}", errors=[problem]) from error


@router.post(
    "",
    status_code=201,
    responses={
        200: {"model": TaskDetail, "description": "This version was there"},
        **problem_responses(403, 409, 413, 415, 422, 503),
    },
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                YAML: {
                    "schema": {"type": "string", "maxLength": MAX_BYTES},
                    "examples": {"bridge": {"summary": "A narrow gap", "value": EXAMPLE}},
                }
            },
        }
    },
)
def add_task(
    text: Annotated[str, Depends(_yaml_text)],
    response: Response,
    context: ContextDep,
    caller: CallerDep,
) -> TaskDetail:
    """Uploads a task, or a new version of one of your own; new submissions get it from then on."""
    catalogue = context.tasks
    try:
        task = parse_custom_task(text, origin="task")
    except TaskError as error:
        raise _refusal(error) from error
    try:
        added = catalogue.add(task, text, owner=caller.key_id, force=caller.is_admin)
    except TaskChangedError as error:
        raise ProblemError(409, str(error)) from error
    response.status_code = 201 if added else 200
    response.headers["Location"] = f"/v1/tasks/{task.name}?version={task.version}"
    return _detail(catalogue.find(task.name, task.version))


@router.get("", response_model=list[TaskView], responses=problem_responses(503))
def list_tasks(context: ContextDep, request: Request) -> Any:
    """Lists the tasks in their newest versions, the built-in ones first."""
    views = [TaskView(**_fields(entry)) for entry in context.tasks.entries()]
    return conditional(request, Answer.of(_LIST.dump_json(views)), "application/json")


@router.get("/{name}", response_model=TaskDetail, responses=problem_responses(404, 422, 503))
def show_task(
    name: Annotated[str, Path(max_length=60, pattern=r"^[a-z0-9-]+$")],
    context: ContextDep,
    request: Request,
    version: Annotated[
        str | None, Query(pattern="^[0-9a-f]{12}$", description="Default: the newest")
    ] = None,
) -> Any:
    """Shows a task with its whole document."""
    view = _detail(context.tasks.find(name, version))
    return conditional(request, Answer.of(view.model_dump_json().encode()), "application/json")


def _fields(entry: CatalogueEntry) -> dict[str, Any]:
    task = entry.task
    return {
        **{name: getattr(task, name) for name in ("name", "version", "title", "category", "level")},
        "statement": task.statement,
        "indicator": task.indicator.name,
        "unit": task.indicator.unit,
        "ceiling": task.ceiling,
        "difficulty": dict(task.difficulty),
        "custom": entry.custom,
        "created_at": entry.created_at,
    }


def _detail(entry: CatalogueEntry) -> TaskDetail:
    return TaskDetail(
        **_fields(entry), current=entry.current, document=dict(entry.task.as_document())
    )


def _refusal(error: TaskError) -> ProblemError:
    return ProblemError(422, str(error), errors=error.issues)
