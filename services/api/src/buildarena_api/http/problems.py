"""Errors as RFC 9457 problem details: the fault, its field, and the valid values."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from difflib import get_close_matches
from enum import StrEnum
from http import HTTPStatus
from types import UnionType
from typing import Any, Final, Self, get_args, get_origin

import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.exc import DataError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from starlette.exceptions import HTTPException

from buildarena_backend.errors import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    RefusedError,
    SubmissionError,
    UnknownIdError,
)
from buildarena_benchmark import SourceError, ValidationIssue
from buildarena_benchmark.environment import NothingToSubmitError


class ErrorCode(StrEnum):
    """Error codes for programs: a code never changes its meaning."""

    status: int
    meaning: str

    def __new__(cls, code: str, status: int, meaning: str) -> Self:
        """Give a code its status and meaning."""
        member = str.__new__(cls, code)
        member._value_, member.status, member.meaning = code, status, meaning
        return member

    INVALID_FIELD = "invalid_field", 422, "A field or parameter has no valid value."
    UNKNOWN_FIELD = "unknown_field", 422, "The body has a field that does not exist."
    UNKNOWN_PARAMETER = "unknown_parameter", 422, "The operation has no such query parameter."
    REPEATED_PARAMETER = "repeated_parameter", 422, "A parameter for one value was given twice."
    CONTRADICTORY_PARAMETERS = "contradictory_parameters", 422, "Two parameters exclude each other."
    UNKNOWN_NAME = "unknown_name", 422, "A name is unknown; `choices` has the valid ones."
    INVALID_CURSOR = "invalid_cursor", 422, "The cursor is not one of this list in this order."
    INVALID_JSON = "invalid_json", 422, "The body is not JSON; the message has line and column."
    INVALID_YAML = "invalid_yaml", 422, "The body is not YAML, or uses what is refused of YAML."
    INVALID_FILE = "invalid_file", 422, "The uploaded file is not what it should be."
    UPLOAD_REFUSED = "upload_refused", 422, "A runner's file or outcome does not fit its trial."
    TOO_DEEP = "too_deep", 422, "The body is nested too deeply."
    BROKEN_BODY = "broken_body", 400, "The body was cut off, or its header is not HTTP."
    KEY_REQUIRED = "key_required", 401, "The request carries no API key."
    KEY_UNKNOWN = "key_unknown", 401, "Nobody has this API key."
    KEY_REFUSED = "key_refused", 401, "The key is revoked, expired, suspended or replaced."
    SCOPE_MISSING = "scope_missing", 403, "The key lacks the scope that the operation needs."
    NOT_OWNER = "not_owner", 403, "It belongs to another key; only an admin may change it."
    NAME_TAKEN = "name_taken", 403, "The name belongs to another key, or looks like one that does."
    NOT_ALLOWED = "not_allowed", 403, "The key's runners may not lease this simulator's jobs."
    FOREIGN_ORIGIN = "foreign_origin", 403, "Without keys, other sites' pages may ask nothing."
    PATH_NOT_FOUND = "path_not_found", 404, "The path does not exist."
    JOB_NOT_FOUND = "job_not_found", 404, "The job does not exist."
    SWEEP_NOT_FOUND = "sweep_not_found", 404, "The sweep does not exist."
    TASK_NOT_FOUND = "task_not_found", 404, "The task does not exist, or not in this version."
    SESSION_NOT_FOUND = "session_not_found", 404, "The agent's session does not exist."
    WORKER_NOT_FOUND = "worker_not_found", 404, "The runner is not on the list of workers."
    KEY_NOT_FOUND = "key_not_found", 404, "The API key does not exist."
    VERIFICATION_NOT_FOUND = "verification_not_found", 404, "The verification does not exist."
    ARTIFACT_NOT_FOUND = "artifact_not_found", 404, "The job has no such artifact, or not yet."
    RESULT_WITHHELD = "result_withheld", 404, "It would reveal hidden numbers before the job ends."
    METHOD_NOT_ALLOWED = "method_not_allowed", 405, "The path has other methods."
    BODY_TIMEOUT = "body_timeout", 408, "The body did not come in time."
    ILLEGAL_STATE = "illegal_state", 409, "The state of the job, sweep or key does not allow it."
    SESSION_CLOSED = "session_closed", 409, "The session takes no calls, or no more of them."
    NOTHING_TO_SUBMIT = "nothing_to_submit", 409, "The session has no machine to submit."
    NO_TEST_TRIAL = "no_test_trial", 409, "The task has no test trials, or none is left."
    LEASE_ENDED = "lease_ended", 409, "The runner's lease is over, or another key's."
    IDEMPOTENCY_KEY_REUSED = "idempotency_key_reused", 409, "The Idempotency-Key had another body."
    TOO_LARGE = "too_large", 413, "The request, or its answer, is too large."
    UNSUPPORTED_MEDIA_TYPE = "unsupported_media_type", 415, "The body is of a type not read here."
    FOREIGN_HOST = "foreign_host", 421, "Without keys, the service answers only to local names."
    HEADER_TOO_LARGE = "header_too_large", 431, "The request's header is too large."
    RATE_LIMITED = "rate_limited", 429, "More requests than the caller may send; see Retry-After."
    TOO_MANY_OPEN = "too_many_open", 429, "The caller has too much of this kind going on."
    INTERNAL_ERROR = "internal_error", 500, "A bug of the service; its log has it."
    ARTIFACT_DAMAGED = "artifact_damaged", 500, "Stored bytes are damaged; a backup has them."
    BUSY = "busy", 503, "All callers together have too much of this kind going on."
    DATABASE_UNAVAILABLE = "database_unavailable", 503, "The database does not answer."
    STORE_UNAVAILABLE = "store_unavailable", 503, "The artifact store does not answer."


PROBLEM_JSON = "application/problem+json"
QUOTED = re.compile(r"'([^']*)'")
"""Pydantic's spelling of the values that it expects."""
BY_STATUS: Final = {
    400: ErrorCode.INVALID_FIELD,  # a body that is not text is as wrong as one that is not JSON
    404: ErrorCode.PATH_NOT_FOUND,
    405: ErrorCode.METHOD_NOT_ALLOWED,
}
"""Codes of what the framework refuses itself."""
RETRY_S: Final = "5"
MAX_SHOWN = 100
"""Characters of a wrong value that are repeated."""

log = structlog.get_logger(__name__)


class Problem(BaseModel):
    """RFC 9457 problem details."""

    type: str = Field(default="about:blank", examples=["about:blank"])
    title: str = Field(examples=["Unprocessable Content"])
    status: int = Field(examples=[422])
    code: ErrorCode = Field(examples=["unknown_name"])
    detail: str = Field(examples=["tasks[0]: unknown task 'support-9'"])
    errors: list[ValidationIssue] = []


class ProblemError(Exception):
    """Answers the request with a problem.

    Attributes:
        code: Error code for programs; it has the HTTP status.
        detail: The same for people.
    """

    def __init__(
        self,
        code: ErrorCode,
        detail: str,
        *,
        errors: Sequence[ValidationIssue] = (),
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.code, self.detail = code, detail
        self.errors, self.headers = list(errors), dict(headers or {})

    def answer(self) -> JSONResponse:
        """Return the problem as it is sent."""
        status = self.code.status
        problem = Problem(
            title=HTTPStatus(status).phrase,
            status=status,
            code=self.code,
            detail=self.detail,
            errors=self.errors,
        )
        content = problem.model_dump(mode="json", by_alias=True)
        return JSONResponse(content, status, self.headers, media_type=PROBLEM_JSON)


def invalid(
    field: str,
    message: str,
    *,
    choices: Iterable[str] = (),
    code: ErrorCode = ErrorCode.INVALID_FIELD,
) -> ProblemError:
    """Return the problem of one field or parameter."""
    issue = ValidationIssue(path=field, message=message, choices=tuple(choices))
    return ProblemError(code, _describe(issue), errors=[issue])


def unknown(field: str, value: str, choices: Iterable[str]) -> ProblemError:
    """Return the problem of an unknown name."""
    message = f"unknown {field} {value!r}"
    return invalid(field, message, choices=choices, code=ErrorCode.UNKNOWN_NAME)


def require_each(
    field: str, names: Iterable[str] | None, choices: Collection[str], *, more: Collection[str] = ()
) -> None:
    """Refuse a name that is none of the choices, nor of more that are not worth listing.

    Raises:
        ProblemError: One is not; it lists the choices.
    """
    for name in names or ():
        if name not in choices and name not in more:
            raise unknown(field, name, sorted(choices))


def _nearest(issue: ValidationIssue) -> str:
    """Return `; did you mean …?` with the choice nearest to the wrong word, if one is near."""
    quoted = QUOTED.findall(issue.message)
    word = quoted[-1] if quoted else issue.path.rpartition(".")[2]
    matches = get_close_matches(word, issue.choices, 1)
    return f"; did you mean {matches[0]}?" if matches else ""


def database_problem(error: OperationalError | PoolTimeoutError) -> ProblemError:
    """Return the problem for a database without connections, and log it."""
    busy = isinstance(error, PoolTimeoutError)
    event = "database_connections_in_use" if busy else "database_unreachable"
    log.warning(event, error=str(error).splitlines()[0])
    text = "all connections to the database are in use" if busy else "the database can't be reached"
    return ProblemError(
        ErrorCode.DATABASE_UNAVAILABLE, f"{text}; nothing was stored", headers={"Retry-After": "2"}
    )


def add_problem_handlers(app: FastAPI) -> None:
    """Make every error of the app a problem."""

    def handle(kind: type[Exception], problem_of: Callable[[Any], ProblemError]) -> None:
        def answer(_: Request, error: Exception) -> Response:
            return problem_of(error).answer()

        app.add_exception_handler(kind, answer)

    handle(ProblemError, lambda error: error)
    handle(RefusedError, _refusal_problem)
    handle(NothingToSubmitError, lambda e: ProblemError(ErrorCode.NOTHING_TO_SUBMIT, str(e)))
    handle(ArtifactMissingError, lambda e: ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, str(e)))
    handle(UnknownIdError, lambda e: ProblemError(ErrorCode[f"{e.kind}_not_found".upper()], str(e)))
    for of_issues in (SubmissionError, SourceError):
        handle(of_issues, _of_issues)
    handle(OperationalError, database_problem)
    handle(PoolTimeoutError, database_problem)
    handle(HTTPException, _of_framework)
    handle(DataError, _unstorable)
    handle(ArtifactDamagedError, _of_store)
    handle(ArtifactStoreError, _of_store)

    @app.exception_handler(RequestValidationError)
    async def on_invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        return _invalid_request(request, error).answer()

    @app.exception_handler(Exception)
    async def on_bug(request: Request, error: Exception) -> JSONResponse:
        log.error("unexpected", path=request.url.path, exc_info=error)
        detail = "something went wrong here; it is in the log"
        return ProblemError(ErrorCode.INTERNAL_ERROR, detail).answer()


def _refusal_problem(error: RefusedError) -> ProblemError:
    code = ErrorCode[error.code.upper()]
    wait = {"Retry-After": RETRY_S} if code.status == HTTPStatus.TOO_MANY_REQUESTS else None
    return ProblemError(code, str(error), headers=wait)


def _of_issues(error: SubmissionError | SourceError) -> ProblemError:
    # A name with choices, if that is all that is wrong.
    named = all(issue.choices for issue in error.issues)
    code = ErrorCode.UNKNOWN_NAME if named else ErrorCode.INVALID_FIELD
    return ProblemError(code, str(error), errors=error.issues)


def _of_framework(error: HTTPException) -> ProblemError:
    code = BY_STATUS.get(error.status_code, ErrorCode.INTERNAL_ERROR)
    return ProblemError(code, str(error.detail), headers=error.headers)


def _unstorable(error: DataError) -> ProblemError:
    log.info("unstorable", error=str(error.orig))
    detail = "a text or number of the request is none that can be stored or found"
    return ProblemError(ErrorCode.INVALID_FIELD, detail)


def _of_store(error: ArtifactDamagedError | ArtifactStoreError) -> ProblemError:
    # Where the store is, which the error names, is the operator's affair.
    log.error("artifact_store_fails", error=str(error))
    if isinstance(error, ArtifactDamagedError):
        detail = "a stored file is damaged; it must be restored from a backup"
        return ProblemError(ErrorCode.ARTIFACT_DAMAGED, detail)
    detail = "files can't be stored or read now; nothing is lost"
    return ProblemError(ErrorCode.STORE_UNAVAILABLE, detail, headers={"Retry-After": RETRY_S})


def _invalid_request(request: Request, error: RequestValidationError) -> ProblemError:
    """Return the problem for FastAPI's validation errors."""
    entries = error.errors()
    if entries[0]["type"] == "json_invalid":
        return _invalid_json(error)
    body = getattr(request.scope.get("route"), "body_field", None)
    schema = None if body is None else body.field_info.annotation
    issues = [_issue(entry, schema) for entry in entries]
    detail = "; ".join(map(_describe, issues))
    # A path that nothing can have is as unknown as one that nothing has.
    if any(entry["loc"][0] == "path" for entry in entries):
        return ProblemError(ErrorCode.PATH_NOT_FOUND, detail, errors=issues)
    extra = all(entry["type"] == "extra_forbidden" for entry in entries)
    code = ErrorCode.UNKNOWN_FIELD if extra else ErrorCode.INVALID_FIELD
    return ProblemError(code, detail, errors=issues)


def _invalid_json(error: RequestValidationError) -> ProblemError:
    text = error.body.decode(errors="replace") if isinstance(error.body, bytes) else error.body
    try:
        json.loads(str(text))
    except json.JSONDecodeError as syntax:
        message = f"{syntax.msg}, line {syntax.lineno}, column {syntax.colno}"
        issue = ValidationIssue(path="body", message=message, line=syntax.lineno)
        return ProblemError(ErrorCode.INVALID_JSON, f"not JSON: {message}", errors=[issue])
    return ProblemError(ErrorCode.INVALID_JSON, "the body is not JSON")


def _issue(entry: Mapping[str, Any], schema: Any) -> ValidationIssue:
    """Return one mistake; where values are spelled out, with the value and the choices."""
    path, message = _field(entry["loc"]), str(entry["msg"])
    if entry["type"] == "extra_forbidden":
        choices = _sibling_fields(entry["loc"], schema)
        return ValidationIssue(path=path, message="unknown field", choices=choices)
    if entry["type"] not in {"literal_error", "enum"}:
        return ValidationIssue(path=path, message=message)
    value = repr(entry["input"])[:MAX_SHOWN]
    choices = tuple(QUOTED.findall(message))
    return ValidationIssue(path=path, message=f"unknown value {value}", choices=choices)


def _sibling_fields(location: Sequence[str | int], schema: Any) -> tuple[str, ...]:
    """Return the names of the fields that are valid where an unknown one was found."""
    for step in location[1:-1]:
        node = _model_in(schema)
        schema = node.model_fields[step].annotation if node and step in node.model_fields else None
    node = _model_in(schema)
    return () if node is None else tuple(node.model_fields)


def _model_in(kind: Any) -> type[BaseModel] | None:
    """Return the model that a type is, or may be, or is a list of."""
    if isinstance(kind, type) and not get_origin(kind) and issubclass(kind, BaseModel):
        return kind
    inside = get_args(kind) if get_origin(kind) in {list, UnionType} else ()
    return next((model for model in map(_model_in, inside) if model is not None), None)


def _describe(issue: ValidationIssue) -> str:
    choices = f"; choose from {', '.join(issue.choices)}" if issue.choices else ""
    return f"{issue.path}: {issue.message}{choices}{_nearest(issue)}"


def _field(location: Sequence[str | int]) -> str:
    """Return ``("body", "tasks", 1)`` as ``tasks[1]``; a parameter by its name."""
    if location[0] == "query":
        return str(location[-1] if len(location) == 1 else location[1])
    parts = [part for part in location if part not in {"body", "query", "path", "header"}]
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or str(location[0])
