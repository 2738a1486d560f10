"""The API as the command line sees it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import time
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from buildarena_cli.defaults import KEY_VARIABLE, kept_key
from buildarena_cli.errors import CommandError
from buildarena_cli.near import near_field

if TYPE_CHECKING:
    from buildarena_cli.wire import Response

TIMEOUT_S = 60.0
PATIENCE_S = 60.0
"""How long a watching command waits for a service that is being restarted."""
STATE_POLL_S = 0.3
HEALTH = "/v1/health"
BUSY_PATIENCE_S = 10.0
"""How long a command that only reads waits for a service that is too busy."""
LONGEST_PAUSE_S = 10.0
"""How long a refused request waits at most before it is sent again, whatever the service asks."""
PATH = re.compile(r"/v1(?:/(?!\.{1,2}(?:/|\?|$))[A-Za-z0-9._~%-]+)+(?:\?[!-\"$-~]*)?")
"""Every path that is asked for: its parts are quoted, and none leads elsewhere."""
CHUNK_BYTES = 1 << 20


def at(*parts: str) -> str:
    """The path of something in the API; its parts can't reach another route.

    Raises:
        CommandError: A part is not a name.
    """
    for part in parts:
        # A server takes %2F for a slash.
        if part in {"", ".", ".."} or "/" in part or not part.isprintable():
            raise CommandError(f"{part!r} is not a name")
    return "/v1/" + "/".join(quote(part, safe="") for part in parts)


def _checked(path: str) -> str:
    if PATH.fullmatch(path) is None:
        raise CommandError(f"{path!r} is not a path of the service")
    return path


class Client:
    """Sends requests and turns problems into CommandErrors.

    Args:
        url: Where the API is, for example ``http://127.0.0.1:8321``.
        key: The API key; by default the one in BUILDARENA_KEY, if any.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        # Help and completion load this module, and send nothing by it.
        from buildarena_cli.wire import Failure, Wire

        self._failure = Failure
        self.url = url.rstrip("/")
        try:
            key = key or kept_key()
        except ValueError as error:
            raise CommandError(str(error)) from error
        if key and not (key.isascii() and key.isprintable()):
            raise CommandError(f"{KEY_VARIABLE} is not a key: keys are printable ASCII")
        try:
            self._wire = Wire(self.url, {"Authorization": f"Bearer {key}"} if key else {})
        except ValueError as error:
            raise CommandError(f"{self.url!r} is not the URL of an API: {error}") from error

    def get(self, path: str, **params: Any) -> Any:
        """The JSON answer to a GET; parameters that are None are left out."""
        return _document(self._answer("GET", path, params=_given(params)))

    def get_bytes(self, path: str, *, accept: str | None = None, **params: Any) -> bytes:
        """The bytes of a GET; parameters that are None are left out.

        Args:
            path: What is asked for.
            accept: Media type that is wanted, where there are several.
            params: Parameters of the request.
        """
        headers = {"Accept": accept} if accept else None
        return self._answer("GET", path, params=_given(params), headers=headers).body

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
        return self._send_json("POST", path, body)

    def download(self, path: str, target: Path) -> None:
        """Writes the answer to a GET into a file, which is there whole or not at all."""
        partial = target.with_name(target.name + ".partial")
        with contextlib.closing(self._patient_chunks(path)) as chunks:
            first = next(chunks)
            with partial.open("wb") as file:
                file.write(first)
                for chunk in chunks:
                    file.write(chunk)
        partial.replace(target)

    def upload(self, path: str, source: Path, media_type: str) -> Any:
        """The JSON answer to a POST of a file."""
        with source.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            headers = {"Content-Type": media_type, "Content-Length": str(size)}
            return _document(self._answer("POST", path, body=file, headers=headers, timeout_s=None))

    def put(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON answer to a PUT."""
        return self._send_json("PUT", path, body)

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

    def get_in_state(self, path: str, state: str) -> Any:
        """As get_patiently, once what is there says that it is in a state."""
        while (answer := self.get_patiently(path))["state"] != state:
            time.sleep(STATE_POLL_S)
        return answer

    def _patient_chunks(self, path: str) -> Generator[bytes, None, None]:
        """As _chunks, but waits while the service has too much going on."""
        patience = _Patience("GET")
        while True:
            try:
                yield from self._chunks(path)
            except RefusedError as error:
                if not patience.waits(error.response):
                    raise
            else:
                return

    def _chunks(self, path: str) -> Generator[bytes, None, None]:
        """The pieces of an answer; at least one, and all of them or an error."""
        with self._sending(), self._wire.opened("GET", _checked(path), timeout_s=None) as answer:
            if answer.status != 200:  # noqa: PLR2004 - OK
                raise RefusedError(self._wire.read(path, answer))
            chunk = answer.read(CHUNK_BYTES)
            yield chunk
            while chunk:
                chunk = answer.read(CHUNK_BYTES)
                yield chunk
            if answer.length:
                raise UnreachableError(f"{self.url} broke off: {answer.length:,} bytes are missing")

    def _send_json(self, method: str, path: str, body: Mapping[str, Any]) -> Any:
        headers = {"Content-Type": "application/json"}
        sent = json.dumps(dict(body)).encode()
        return _document(self._answer(method, path, body=sent, headers=headers))

    def _answer(
        self, method: str, path: str, *, timeout_s: float | None = TIMEOUT_S, **options: Any
    ) -> Response:
        patience = _Patience(method)
        while True:
            with self._sending():
                response = self._wire.send(method, _checked(path), timeout_s=timeout_s, **options)
            if path == HEALTH or not patience.waits(response):
                break
            if hasattr(options.get("body"), "seek"):
                options["body"].seek(0)
        if path == HEALTH:
            return response
        if response.status == 503:  # noqa: PLR2004 - Service Unavailable
            raise UnreachableError(_problem(response))
        if response.status == 401:  # noqa: PLR2004 - Unauthorized
            raise CommandError(
                f"{_problem(response)}: set {KEY_VARIABLE} or {KEY_VARIABLE}_FILE to a valid key"
            )
        if response.failed:
            raise RefusedError(response)
        return response

    @contextlib.contextmanager
    def _sending(self) -> Iterator[None]:
        try:
            yield
        except self._failure as error:
            raise UnreachableError(
                f"no BuildArena answers at {self.url} ({error}): start it with `buildarena up`, "
                "or name another with --url or BUILDARENA_URL"
            ) from error


class RefusedError(CommandError):
    """The service refused a request.

    Args:
        response: What it answered.

    Attributes:
        response: What it answered.
        status: The HTTP status.
        errors: Its field errors: ``field``, ``message``, ``line`` and ``choices`` of each.
    """

    def __init__(self, response: Response) -> None:
        super().__init__(_problem(response))
        self.response = response
        self.status = response.status
        self.errors: list[dict[str, Any]] = []
        with contextlib.suppress(ValueError, KeyError, TypeError):
            self.errors = list(response.json()["errors"])


class _Patience:
    """Waits as the service asks, when it has too much going on, and gives up in the end."""

    def __init__(self, method: str) -> None:
        started = time.monotonic()
        self._until = {429: started + PATIENCE_S}
        if method == "GET":
            # A change may have been made before the service became unavailable.
            self._until[503] = started + BUSY_PATIENCE_S

    def waits(self, response: Response) -> bool:
        """Waits before a request is sent again; False when it is not to be."""
        asked = response.retry_after
        if response.status not in self._until or not asked.isdecimal():
            return False
        pause_s = min(float(asked), LONGEST_PAUSE_S)
        if time.monotonic() + pause_s > self._until[response.status]:
            return False
        time.sleep(pause_s)
        return True


class UnreachableError(CommandError):
    """The service does not answer now; it may later."""


def _document(response: Response) -> Any:
    try:
        return response.json()
    except ValueError as error:
        raise CommandError(
            f"{response.url} is not BuildArena: it does not answer in JSON"
        ) from error


def _given(params: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in params.items() if value is not None}


def _problem(response: Response) -> str:
    try:
        problem = response.json()
        errors = problem["errors"]
        detail = str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {response.status} from {response.url}"
    if not errors:
        return detail
    return "\n".join(map(_line, errors))


def _line(error: Mapping[str, Any]) -> str:
    line = f"{error['field']}: {error['message']}"
    if error["choices"]:
        line += f"; choose from {', '.join(error['choices'])}"
        line += near_field(error["field"], error["message"], error["choices"])
    return line
