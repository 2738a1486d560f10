"""The API as the command line sees it."""

from __future__ import annotations

import contextlib
import os
import time
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx

from buildarena_cli.errors import CommandError

TIMEOUT_S = 60.0
KEY_VARIABLE = "BUILDARENA_KEY"
"""The environment variable of the API key: on a command line, others could read it."""
PATIENCE_S = 60.0
"""How long a watching command puts up with a service that is being restarted."""


class Client:
    """Sends requests and turns problems into CommandErrors.

    Args:
        url: Where the API is, for example ``http://127.0.0.1:8321``.
        key: The API key; by default the one in BUILDARENA_KEY, if any.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        self.url = url.rstrip("/")
        key = key or os.environ.get(KEY_VARIABLE)
        self._http = httpx.Client(
            base_url=self.url,
            timeout=TIMEOUT_S,
            transport=httpx.HTTPTransport(retries=2),
            headers={"Authorization": f"Bearer {key}"} if key else None,
        )
        # Commands let go of their client when they end.
        weakref.finalize(self, self._http.close)

    def get(self, path: str, **params: Any) -> Any:
        """The JSON answer to a GET; parameters that are None are left out."""
        given = {name: value for name, value in params.items() if value is not None}
        return self._answer("GET", path, params=given).json()

    def get_bytes(self, path: str, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out."""
        given = {name: value for name, value in params.items() if value is not None}
        return self._answer("GET", path, params=given or None).content

    def post(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON answer to a POST."""
        return self._answer("POST", path, json=dict(body)).json()

    def download(self, path: str, target: Path) -> None:
        """Writes the answer to a GET into a file, which is there whole or not at all."""
        partial = target.with_name(target.name + ".partial")
        with self._http.stream("GET", path, timeout=None) as response:
            if response.is_error:
                response.read()
                raise CommandError(_problem(response))
            with partial.open("wb") as file:
                for chunk in response.iter_bytes():
                    file.write(chunk)
        partial.replace(target)

    def upload(self, path: str, source: Path, media_type: str) -> Any:
        """The JSON answer to a POST of a file."""
        with source.open("rb") as file:
            headers = {"Content-Type": media_type}
            return self._answer("POST", path, content=file, headers=headers, timeout=None).json()

    def put(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON answer to a PUT."""
        return self._answer("PUT", path, json=dict(body)).json()

    def get_patiently(self, path: str) -> Any:
        """As get, but waits while the service is unreachable or says 503."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                return self.get(path)
            except UnreachableError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.5)

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def _answer(self, method: str, path: str, **options: Any) -> httpx.Response:
        try:
            response = self._http.request(method, path, **options)
        except httpx.InvalidURL as error:
            raise CommandError(f"{self.url!r} is no URL: {error}") from error
        except httpx.TransportError as error:
            raise UnreachableError(
                f"no BuildArena answers at {self.url} ({error}): start it with `buildarena up`, "
                "or name another with --url or BUILDARENA_URL"
            ) from error
        if response.status_code == httpx.codes.SERVICE_UNAVAILABLE and path != "/v1/health":
            raise UnreachableError(_problem(response))
        if response.status_code == httpx.codes.UNAUTHORIZED:
            raise CommandError(f"{_problem(response)}: set {KEY_VARIABLE} to a good one")
        if response.is_error and path != "/v1/health":
            raise RefusedError(response)
        return response


class RefusedError(CommandError):
    """The service refused a request.

    Attributes:
        status: The HTTP status.
        errors: Its field errors: ``field``, ``message``, ``line`` and ``choices`` of each.
    """

    def __init__(self, response: httpx.Response) -> None:
        super().__init__(_problem(response))
        self.status = response.status_code
        self.errors: list[dict[str, Any]] = []
        with contextlib.suppress(ValueError, KeyError, TypeError):
            self.errors = list(response.json()["errors"])


class UnreachableError(CommandError):
    """The service does not answer now; it may later."""


def _problem(response: httpx.Response) -> str:
    try:
        problem = response.json()
        errors = problem["errors"]
        detail = str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {response.status_code} from {response.url}"
    if not errors:
        return detail
    lines = []
    for error in errors:
        line = f"{error['field']}: {error['message']}"
        if error["choices"]:
            line += f"; choose from {', '.join(error['choices'])}"
        lines.append(line)
    return "\n".join(lines)
