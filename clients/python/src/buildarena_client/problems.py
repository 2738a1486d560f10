"""Errors from answers that are not a success."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from buildarena_client.errors import (
    ClientError,
    KeyRefusedError,
    NotAnApiError,
    UnavailableError,
    kind_of,
)
from buildarena_client.requests import Request, Response

HIDDEN = "[key]"


def require_success(request: Request, response: Response, *, key: str | None) -> Response:
    """The answer, if it is a success.

    Args:
        request: What was asked.
        response: What was answered.
        key: Hidden in messages, even where the answer repeats it.

    Raises:
        UnavailableError: The service can't answer now.
        RefusedError: It refused.
    """
    if response.failed and not request.about_health:
        raise _failure(response, key)
    return response


def document(response: Response) -> Any:
    """The JSON of an answer.

    Raises:
        NotAnApiError: It has none.
    """
    try:
        return response.json()
    except (ValueError, RecursionError) as error:
        raise NotAnApiError(
            f"{response.url} is not BuildArena: it does not answer in JSON"
        ) from error


def next_cursor(page: Any, url: str) -> str | None:
    """Where the page behind one begins; None behind the last.

    Raises:
        NotAnApiError: It is no page of a list.
    """
    if not isinstance(page, dict) or not isinstance(page.get("next_cursor", 0), str | None):
        raise NotAnApiError(f"{url} is not BuildArena: a page of a list lacks its next_cursor")
    cursor: str | None = page["next_cursor"]
    return cursor


def _failure(response: Response, key: str | None) -> ClientError:
    detail, errors = _problem(response, key)
    if response.status == HTTPStatus.SERVICE_UNAVAILABLE:
        return UnavailableError(detail)
    kind = kind_of(response.status)
    if kind is KeyRefusedError:
        errors = []
    return kind(response.status, detail, errors)


def _problem(response: Response, key: str | None) -> tuple[str, list[dict[str, Any]]]:
    """What a problem says, without the key, which a server may repeat."""
    plain = f"HTTP {response.status} from {response.url}"
    try:
        problem = response.json()
        detail, errors = str(problem["detail"]), [_issue(error, key) for error in problem["errors"]]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return plain, []
    return _without(detail, key), errors


def _issue(error: dict[str, Any], key: str | None) -> dict[str, Any]:
    return {
        "field": _without(str(error.get("field", "")), key),
        "message": _without(str(error["message"]), key),
        "line": error.get("line"),
        "choices": [_without(str(choice), key) for choice in error.get("choices") or ()],
    }


def _without(text: str, key: str | None) -> str:
    return text.replace(key, HIDDEN) if key else text
