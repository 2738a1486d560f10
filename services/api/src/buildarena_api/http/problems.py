"""Errors as RFC 9457 problem details: what went wrong, in which field, and what would be valid."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from typing import Any, Final

import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.exc import DataError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from starlette.exceptions import HTTPException
from starlette.types import Send

from buildarena_backend.errors import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    EndedKeyError,
    NameTakenError,
    NotOwnedError,
    SubmissionError,
    TooManyFilesError,
    TransitionError,
    UnknownIdError,
)
from buildarena_benchmark import ValidationIssue

PROBLEM_JSON = "application/problem+json"
QUOTED = re.compile(r"'([^']*)'")
"""How pydantic spells the values that it expects."""
PLAIN: Final[Mapping[type[Exception], tuple[int, int | None]]] = {
    TransitionError: (409, None),
    EndedKeyError: (409, None),
    NotOwnedError: (403, None),
    NameTakenError: (403, None),
    TooManyFilesError: (429, 5),
    UnknownIdError: (404, None),
    ArtifactMissingError: (404, None),
}
"""Status of errors that say all there is to say, and when the caller may come back."""
MAX_SHOWN = 100
"""Characters of a wrong value that are repeated."""

log = structlog.get_logger(__name__)


class Problem(BaseModel):
    """RFC 9457 problem details."""

    type: str = Field(default="about:blank", examples=["about:blank"])
    title: str = Field(examples=["Unprocessable Content"])
    status: int = Field(examples=[422])
    detail: str = Field(examples=["tasks[0]: there is no task 'support-9'"])
    errors: list[ValidationIssue] = []


class ProblemError(Exception):
    """Answers the request with a problem.

    Attributes:
        status: HTTP status.
        detail: What went wrong, for people.
        errors: What is wrong with the request.
        headers: Headers of the answer.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        errors: Sequence[ValidationIssue] = (),
        headers: dict[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.errors = list(errors)
        self.headers = headers


def database_problem(error: OperationalError | PoolTimeoutError) -> ProblemError:
    """What is answered while the database gives no connection; it is in the log."""
    busy = isinstance(error, PoolTimeoutError)
    event = "database_connections_in_use" if busy else "database_unreachable"
    log.warning(event, error=str(error).splitlines()[0])
    what = "all connections to the database are in use" if busy else "the database can't be reached"
    return ProblemError(503, f"{what}; nothing was stored", headers={"Retry-After": "2"})


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """OpenAPI entries of the problems that an operation answers with."""
    return {
        status: {
            "model": Problem,
            "description": HTTPStatus(status).phrase,
            "content": {PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        for status in statuses
    }


def _answer(
    status: int,
    detail: str,
    errors: Sequence[ValidationIssue] = (),
    headers: dict[str, str] | None = None,
) -> JSONResponse:
    problem = Problem(
        title=HTTPStatus(status).phrase, status=status, detail=detail, errors=list(errors)
    )
    return JSONResponse(
        problem.model_dump(mode="json", by_alias=True),
        status_code=status,
        media_type=PROBLEM_JSON,
        headers=headers,
    )


async def send_problem(
    send: Send, status: int, detail: str, *, headers: Mapping[str, str] | None = None
) -> None:
    """Answers a request that no route was asked for with a problem."""
    answer = _answer(status, detail, headers=dict(headers or {}))
    start = {"type": "http.response.start", "status": status, "headers": answer.raw_headers}
    await send(start)
    await send({"type": "http.response.body", "body": answer.body})


def add_problem_handlers(app: FastAPI) -> None:
    """Makes every error of the app a problem."""

    @app.exception_handler(ProblemError)
    async def on_problem(_: Request, error: ProblemError) -> JSONResponse:
        return _answer(error.status, error.detail, error.errors, error.headers)

    @app.exception_handler(SubmissionError)
    async def on_submission(_: Request, error: SubmissionError) -> JSONResponse:
        return _answer(422, str(error), error.issues)

    @app.exception_handler(RequestValidationError)
    async def on_invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        errors = [_issue(entry) for entry in error.errors()]
        detail = "; ".join(map(_described, errors))
        # A path that nothing can have is as unknown as one that nothing has.
        in_path = any(entry["loc"][0] == "path" for entry in error.errors())
        return _answer(404 if in_path else 422, detail, errors)

    @app.exception_handler(HTTPException)
    async def on_http(_: Request, error: HTTPException) -> JSONResponse:
        headers = dict(error.headers) if error.headers else None
        status = error.status_code
        if status == HTTPStatus.BAD_REQUEST:
            # A body that is not text is as wrong as one that is not JSON, and answered like it.
            status = HTTPStatus.UNPROCESSABLE_ENTITY
        return _answer(status, str(error.detail), headers=headers)

    @app.exception_handler(Exception)
    async def on_bug(request: Request, error: Exception) -> JSONResponse:
        log.error("unexpected", path=request.url.path, exc_info=error)
        return _answer(500, "something went wrong here; it is in the log")

    for kind, (status, wait_s) in PLAIN.items():
        app.add_exception_handler(kind, _plain(status, wait_s))
    _add_store_handlers(app)


def _plain(status: int, wait_s: int | None) -> Callable[[Request, Exception], Response]:
    """Answers an error with what it says itself."""
    headers = None if wait_s is None else {"Retry-After": str(wait_s)}

    def answer(_: Request, error: Exception) -> Response:
        return _answer(status, str(error), headers=headers)

    return answer


def _add_store_handlers(app: FastAPI) -> None:
    @app.exception_handler(DataError)
    async def on_unstorable(_: Request, error: DataError) -> JSONResponse:
        log.info("unstorable", error=str(error.orig))
        return _answer(422, "a text or number of the request is none that can be stored or found")

    @app.exception_handler(OperationalError)
    @app.exception_handler(PoolTimeoutError)
    async def on_database(_: Request, error: OperationalError | PoolTimeoutError) -> JSONResponse:
        problem = database_problem(error)
        return _answer(problem.status, problem.detail, headers=problem.headers)

    @app.exception_handler(ArtifactDamagedError)
    async def on_damaged(_: Request, error: ArtifactDamagedError) -> JSONResponse:
        log.error("artifact_damaged", error=str(error))
        return _answer(500, f"{error}; it must be restored from a backup")

    @app.exception_handler(ArtifactStoreError)
    async def on_store(_: Request, error: ArtifactStoreError) -> JSONResponse:
        log.error("artifact_store_fails", error=str(error))
        return _answer(503, f"{error}; nothing is lost", headers={"Retry-After": "5"})


def _issue(entry: Mapping[str, Any]) -> ValidationIssue:
    """What FastAPI found; where values are spelled out, with the value and the choices."""
    path, message = _field(entry["loc"]), str(entry["msg"])
    if entry["type"] not in {"literal_error", "enum"}:
        return ValidationIssue(path=path, message=message)
    given = repr(entry["input"])[:MAX_SHOWN]
    choices = tuple(QUOTED.findall(message))
    return ValidationIssue(path=path, message=f"there is no such value: {given}", choices=choices)


def _described(issue: ValidationIssue) -> str:
    choices = f"; choose from {', '.join(issue.choices)}" if issue.choices else ""
    return f"{issue.path}: {issue.message}{choices}"


def _field(location: Sequence[str | int]) -> str:
    """``("body", "tasks", 1)`` as ``tasks[1]``."""
    parts = [part for part in location if part not in {"body", "query", "path", "header"}]
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or str(location[0])
