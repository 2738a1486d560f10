"""The OpenAPI document, with the parts that all operations share."""

from __future__ import annotations

import json
import re
from http import HTTPStatus
from typing import Any, Final

from fastapi import FastAPI

from buildarena_api.http.bodies import YAML
from buildarena_api.http.problems import PROBLEM_JSON, ErrorCode, Problem

JSON: Final = "application/json"
REFERENCE: Final = "#/components/schemas/"
OPEN: Final = "/v1/health"
"""The path that is open to everyone."""
STREAM: Final = "text/event-stream"
ABOUT: Final = """\
# The HTTP API

The contract is `/openapi.json`, with a page at `/docs`. For every operation:

- A list is `{"data": [...], "next_cursor": ...}`: pass `next_cursor` as `cursor` for the next page,
  which has up to `limit` rows. Filters can be repeated; unknown parameters are refused.
- An object has its `id`; others name it `job_id`, `sweep_id`, `key_id`. Moments end in `_at`, in
  UTC, lengths in `_s`, money in `_usd`. Empty is `[]` or `{}`; null is unknown.
- What creates answers 201, or 200 where an equal one exists, and takes an `Idempotency-Key`. A JSON
  body may be YAML.
- `RateLimit-*` headers say how many requests are left.
- An error is a problem (RFC 9457); programs go by its `code`:
"""


def describe(app: FastAPI) -> None:
    """Add the parts that all operations share to the app's document."""
    plain = app.openapi

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _complete_document(plain())
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign]


def _complete_document(plain: dict[str, Any]) -> dict[str, Any]:
    problem = Problem.model_json_schema(ref_template=REFERENCE + "{model}")
    schemas = plain["components"]["schemas"] | problem.pop("$defs") | {"Problem": problem}
    for path, operations in plain["paths"].items():
        for method, operation in operations.items():
            _complete(path, method, operation)
    named = {
        _schema_name(name): {**schema, "title": _schema_name(name)}
        for name, schema in schemas.items()
        if name not in {"HTTPValidationError", "ValidationError"}
    }
    for schema in named.values():
        for field in schema.get("properties", {}).values():
            # Docstrings of fields, in one line and without the last full stop.
            if "description" in field:
                field["description"] = " ".join(field["description"].split()).removesuffix(".")
    if len(named) != len(schemas) - 2:
        raise ValueError("two schemas have one name")
    plain["components"]["schemas"] = dict(sorted(named.items()))
    text = re.sub(
        rf'"{REFERENCE}(\w+)"',
        lambda match: f'"{REFERENCE}{_schema_name(match[1])}"',
        json.dumps(plain),
    )
    match: dict[str, Any] = json.loads(text)
    return match


def _schema_name(name: str) -> str:
    """Return the schema's name of a class: ``Job`` of ``JobView``, the response of a job."""
    listed = re.fullmatch(r"Page_(\w+)_", name)
    return _schema_name(listed[1]) + "List" if listed else name.removesuffix("View")


def _complete(path: str, method: str, operation: dict[str, Any]) -> None:
    """Add the responses of every operation, and YAML as a type of every JSON body."""
    answers, body = operation["responses"], operation.get("requestBody", {}).get("content", {})
    statuses = {400, 405, 422, 500} if path == OPEN else {400, 401, 403, 405, 422, 429, 500, 503}
    names = {parameter["name"] for parameter in operation.get("parameters", ())}
    statuses |= {404} if "{" in path or names & {"sweep", "task"} else set()
    statuses |= {409} if method in {"post", "put"} else set()
    statuses |= {408, 413} if body else set()
    for status in statuses:
        problem = {PROBLEM_JSON: {"schema": {"$ref": REFERENCE + "Problem"}}}
        answers[str(status)] = {"description": HTTPStatus(status).phrase, "content": problem}
    if JSON in body and not path.startswith("/v1/runner"):
        body.setdefault(YAML, body[JSON])
    if "201" in answers:
        answers["200"]["content"] = answers["201"]["content"]
    if STREAM in answers["200" if "200" in answers else "204"].get("content", {}):
        del answers["200"]["content"][JSON]
    operation["responses"] = dict(sorted(answers.items()))


def api_page() -> str:
    """Return the document about the API, with the codes of its errors."""
    rows = [f"| `{code}` | {code.status} | {code.meaning} |" for code in ErrorCode]
    return "\n".join([ABOUT, "| code | status | meaning |", "|---|---|---|", *rows]) + "\n"
