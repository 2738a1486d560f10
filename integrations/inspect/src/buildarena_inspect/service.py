"""The service's HTTP API, as far as an import needs it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Final, Self

import httpx

from buildarena_inspect.errors import ServiceError

TIMEOUT_S: Final = 60.0
PATIENCE_S: Final = 120.0
"""How long a request is sent again to a service that has too much going on."""
POLL_S: Final = 0.5
BUSY: Final = frozenset({429, 503})


class RefusedError(ServiceError):
    """The service refused a request.

    Attributes:
        status: The HTTP status.
    """

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


class Service:
    """A service that takes sessions.

    Args:
        url: Where its API is.
        key: The user's key, if it asks for one.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        try:
            self._client = httpx.Client(base_url=url, headers=headers, timeout=TIMEOUT_S)
        except (httpx.InvalidURL, ValueError) as error:
            raise ServiceError(f"{url!r} is not the URL of an API: {error}") from error
        self._url = url

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client.close()

    def get(self, path: str, **params: str) -> Any:
        """The JSON answer to a GET."""
        return self._sent("GET", path, params=params)

    def post(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        """The JSON answer to a POST."""
        return self._sent("POST", path, json=dict(body or {}))

    def ended(self, job_id: str, within_s: float) -> dict[str, Any]:
        """A job once it has ended, or as it is when the time is over."""
        until = time.monotonic() + within_s
        while True:
            job: dict[str, Any] = self.get(f"/v1/jobs/{job_id}")
            if job["state"] == "done" or time.monotonic() > until:
                return job
            time.sleep(POLL_S)

    def _sent(self, method: str, path: str, **options: Any) -> Any:
        until = time.monotonic() + PATIENCE_S
        while True:
            try:
                answer = self._client.request(method, path, **options)
            except httpx.HTTPError as error:
                raise ServiceError(f"no BuildArena answers at {self._url}: {error}") from error
            pause = answer.headers.get("Retry-After", "")
            if answer.status_code not in BUSY or not pause.isdecimal():
                break
            if time.monotonic() + int(pause) > until:
                break
            time.sleep(int(pause))
        if answer.is_success:
            return answer.json()
        raise RefusedError(answer.status_code, _problem(answer))


def _problem(answer: httpx.Response) -> str:
    try:
        problem = answer.json()
        faults = [f"{fault['field']}: {fault['message']}" for fault in problem.get("errors") or ()]
        return "; ".join(faults) or str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {answer.status_code} from {answer.url}"
