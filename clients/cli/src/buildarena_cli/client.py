"""The API as the command line sees it."""

from __future__ import annotations

import contextlib
import os
import time
import weakref
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from buildarena_cli.defaults import KEY_VARIABLE
from buildarena_cli.errors import CommandError
from buildarena_cli.near import QUOTED, did_you_mean, near_field

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 60.0
PATIENCE_S = 60.0
"""How long a watching command puts up with a service that is being restarted."""
HEALTH = "/v1/health"


def at(*parts: str) -> str:
    """The path of something in the API; its parts can't reach another route.

    Raises:
        CommandError: A part means a folder to servers, not a name.
    """
    for part in parts:
        if part in {"", ".", ".."}:
            raise CommandError(f"{part!r} is not a name")
    return "/v1/" + "/".join(quote(part, safe="") for part in parts)


class Client:
    """Sends requests and turns problems into CommandErrors.

    Args:
        url: Where the API is, for example ``http://127.0.0.1:8321``.
        key: The API key; by default the one in BUILDARENA_KEY, if any.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        import httpx

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
        return self._answer("GET", path, params=_given(params)).json()

    def get_bytes(self, path: str, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out."""
        return self._answer("GET", path, params=_given(params) or None).content

    def pages(self, path: str, *, cursor: str | None = None, **params: Any) -> Iterator[Any]:
        """The answer to a GET of a list, and those of the pages behind it.

        Args:
            path: The list's.
            cursor: Where to begin; the first page by default.
            params: Further parameters; those that are None are left out.
        """
        while True:
            page = self.get(path, cursor=cursor, **params)
            yield page
            cursor = page["next_cursor"]
            if cursor is None:
                return

    def post(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON answer to a POST."""
        return self._answer("POST", path, json=dict(body)).json()

    def download(self, path: str, target: Path) -> None:
        """Writes the answer to a GET into a file, which is there whole or not at all."""
        partial = target.with_name(target.name + ".partial")
        with self._sending(), self._http.stream("GET", path, timeout=None) as response:
            if response.is_error:
                response.read()
                raise RefusedError(response)
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
        with self._sending():
            response = self._http.request(method, path, **options)
        if path == HEALTH:
            return response
        if response.status_code == 503:  # noqa: PLR2004 - Service Unavailable
            raise UnreachableError(_problem(response))
        if response.status_code == 401:  # noqa: PLR2004 - Unauthorized
            raise CommandError(f"{_problem(response)}: set {KEY_VARIABLE} to a good one")
        if response.is_error:
            raise RefusedError(response, options.get("params"))
        return response

    @contextlib.contextmanager
    def _sending(self) -> Iterator[None]:
        import httpx

        try:
            yield
        except (httpx.InvalidURL, httpx.UnsupportedProtocol) as error:
            raise CommandError(f"{self.url!r} is not a URL: {error}") from error
        except httpx.TransportError as error:
            raise UnreachableError(
                f"no BuildArena answers at {self.url} ({error}): start it with `buildarena up`, "
                "or name another with --url or BUILDARENA_URL"
            ) from error


class RefusedError(CommandError):
    """The service refused a request.

    Args:
        response: What it answered.
        sent: The request's parameters: what near words are near to.

    Attributes:
        status: The HTTP status.
        errors: Its field errors: ``field``, ``message``, ``line`` and ``choices`` of each.
    """

    def __init__(self, response: httpx.Response, sent: Mapping[str, Any] | None = None) -> None:
        super().__init__(_problem(response, sent or {}))
        self.status = response.status_code
        self.errors: list[dict[str, Any]] = []
        with contextlib.suppress(ValueError, KeyError, TypeError):
            self.errors = list(response.json()["errors"])


class UnreachableError(CommandError):
    """The service does not answer now; it may later."""


def _given(params: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in params.items() if value is not None}


def _problem(response: httpx.Response, sent: Mapping[str, Any] = MappingProxyType({})) -> str:
    try:
        problem = response.json()
        errors = problem["errors"]
        detail = str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {response.status_code} from {response.url}"
    if not errors:
        return detail
    return "\n".join(_line(error, str(sent.get(error["field"], ""))) for error in errors)


def _line(error: Mapping[str, Any], given: str) -> str:
    line = f"{error['field']}: {error['message']}"
    if error["choices"]:
        line += f"; choose from {', '.join(error['choices'])}"
        return line + near_field(error["field"], error["message"], error["choices"])
    # What pydantic says of a word that is none of a few.
    return line + did_you_mean(given, QUOTED.findall(error["message"]))
