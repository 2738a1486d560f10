"""The runner protocol, from the runner's side: each request is sent until it is answered."""

from __future__ import annotations

import hashlib
import ssl
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit
from urllib.request import getproxies

import httpx2
import structlog
from tenacity import (
    RetryCallState,
    RetryError,
    Retrying,
    retry_if_exception_type,
    stop_after_delay,
    stop_when_event_set,
    wait_random_exponential,
)
from tenacity.nap import sleep_using_event
from tenacity.stop import stop_base

from buildarena_backend.errors import StartupError
from buildarena_backend.keepalive import socket_options


class RemoteError(Exception):
    """Base of what a runner's requests raise."""


class LeaseLostError(RemoteError):
    """The lease is over: another worker has the job, it was cancelled, or the runner shuts down."""


class RefusedError(RemoteError):
    """The API refuses the request permanently.

    Attributes:
        status: HTTP status.
    """

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status

    @property
    def is_of_the_key(self) -> bool:
        """True if the key is the reason, so that no other request will succeed either."""
        return self.status in {401, 403}


class UnreachableError(RemoteError):
    """The API did not answer for as long as was waited for it."""


TIMEOUT_S: Final = 15.0
RETRY_FOR_S: Final = 15 * 60.0
"""Time for which an outcome is sent again to an API that does not answer, seconds."""
LONGEST_PAUSE_S: Final = 5.0
LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")
BUSY: Final = (429, 500, 502, 503, 504)
"""Statuses after which the same request may succeed: the service is busy or restarts."""
GONE: Final = 409
PART_BYTES: Final = 1 << 18
"""Size of the parts of an uploaded file, each sent within `TIMEOUT_S`."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldLease:
    """A lease of this runner."""

    job_id: str
    token: int

    @property
    def path(self) -> str:
        """Path of the lease in the API."""
        return f"/v1/runner/leases/{self.job_id}/{self.token}"


class _TryAgainError(Exception):
    """A sending failed that may succeed later."""

    def __init__(self, reason: str, pause_s: float = 0.0) -> None:
        super().__init__(reason)
        self.pause_s = pause_s


def tls_context(ca_file: Path | None) -> ssl.SSLContext:
    """Return a context that verifies certificates with the system's authorities and a file's.

    Raises:
        StartupError: The file can't be read or contains no certificates.
    """
    context = ssl.create_default_context()
    if ca_file is not None:
        try:
            context.load_verify_locations(cafile=str(ca_file))
        except (OSError, ssl.SSLError) as error:
            raise StartupError(
                f"{ca_file} holds no certificates that can be read: {error}"
            ) from error
    return context


def check_url(url: str, *, allow_http: bool) -> str:
    """Return the API's URL without a final slash.

    Raises:
        StartupError: It is invalid, or would send the key unencrypted to another machine.
    """
    parts = urlsplit(url)
    if parts.scheme not in {"http", "https"} or not parts.hostname or parts.username:
        raise StartupError(
            f"{url!r} is not the URL of an API: use https://HOST or http://127.0.0.1"
        )
    if parts.scheme == "http" and parts.hostname not in LOOPBACK and not allow_http:
        raise StartupError(
            f"{url} is not encrypted: others could read the key; use https, or --allow-http where "
            "the network is your own"
        )
    return url.rstrip("/")


class RunnerApi:
    """Thread-safe sender of a runner's requests.

    Args:
        url: Address of the API.
        key: Runner key; None if none is required.
        ca_file: Certificates to trust besides the system's.
        allow_http: True if the key may be sent unencrypted to another machine.
        stopping: Event that ends waiting for trials.
        over: Event that ends all requests. Defaults to `stopping`.

    Raises:
        StartupError: The URL or the certificates are invalid.
    """

    def __init__(
        self,
        url: str,
        key: str | None,
        *,
        ca_file: Path | None = None,
        allow_http: bool = False,
        stopping: threading.Event,
        over: threading.Event | None = None,
    ) -> None:
        tls = tls_context(ca_file)
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        # A wait for a trial is long: a link that died under it is noticed sooner so. With a
        # separate transport, a client leaves out the proxies that the environment names.
        direct = httpx2.HTTPTransport(verify=tls, socket_options=socket_options())
        self._http = httpx2.Client(
            base_url=check_url(url, allow_http=allow_http),
            headers=headers,
            verify=tls,
            timeout=TIMEOUT_S,
            transport=None if getproxies() else direct,
        )
        self._stopping, self._over, self._never = stopping, over or stopping, threading.Event()

    def facts(self, *, retry_for_s: float | None = None) -> dict[str, Any]:
        """Return the key, versions and limits from the API; waits until it answers."""
        facts: dict[str, Any] = self._json(
            "GET", "/v1/runner", retry_for_s=retry_for_s, until=self._stopping
        )
        return facts

    def lease(self, about: Mapping[str, Any], wait_s: float) -> dict[str, Any] | None:
        """Return the next trial, or None if none comes in time; retry while the API is down."""
        answer: dict[str, Any] | None = self._json(
            "POST",
            "/v1/runner/leases",
            json={**about, "wait_s": wait_s},
            timeout=TIMEOUT_S + wait_s,
            retry_for_s=None,
            until=self._stopping,
        )
        return answer

    def heartbeat(
        self, about: Mapping[str, Any], leases: list[HeldLease], *, within_s: float
    ) -> set[HeldLease]:
        """Renew leases and return the lost ones. Sent once: the next one comes soon."""
        body = {**about, "leases": [asdict(lease) for lease in leases]}
        answer = self._json(
            "POST", "/v1/runner/heartbeat", json=body, timeout=within_s, retry_for_s=0.0
        )
        return {HeldLease(**lost) for lost in answer["lost"]}

    def upload(self, lease: HeldLease, data: bytes) -> str:
        """Upload a file and return its SHA-256, by which requests name it."""
        sha256 = hashlib.sha256(data).hexdigest()
        # A list can be sent again where an iterator could not.
        parts = [data[at : at + PART_BYTES] for at in range(0, len(data), PART_BYTES)]
        headers = {"Content-Length": str(len(data))}
        self._json("PUT", f"{lease.path}/uploads/{sha256}", content=parts, headers=headers)
        return sha256

    def end(
        self,
        lease: HeldLease,
        kind: str,
        body: Mapping[str, Any] | None = None,
        *,
        retry_for_s: float = RETRY_FOR_S,
        although_over: bool = False,
    ) -> None:
        """End a lease: ``outcome``, ``fault`` or ``release``.

        Raises:
            LeaseLostError: It had expired.
        """
        self._json(
            "POST",
            f"{lease.path}/{kind}",
            json=None if body is None else dict(body),
            timeout=60.0 if kind == "outcome" else TIMEOUT_S,
            retry_for_s=retry_for_s,
            until=self._never if although_over else None,
        )

    def leave(self, name: str) -> None:
        """Remove the runner from the list of workers."""
        self._json(
            "DELETE",
            f"/v1/runner/workers/{name}",
            timeout=2.0,
            retry_for_s=0.0,
            until=self._never,
        )

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def _json(
        self,
        method: str,
        path: str,
        *,
        retry_for_s: float | None = RETRY_FOR_S,
        until: threading.Event | None = None,
        timeout: float = TIMEOUT_S,
        **options: Any,
    ) -> Any:
        """Return the response, once there is one.

        Args:
            method: HTTP method.
            path: Path in the API.
            retry_for_s: Time for which it is sent again, seconds; None for no limit.
            until: Event that ends the repetition. Defaults to that for all requests.
            timeout: Time limit of one request, seconds.
            options: Options of the request.

        Raises:
            LeaseLostError: 409.
            RefusedError: Any other refusal that will not change.
            UnreachableError: No response came in time, or the runner is stopping.
        """
        stopping = self._over if until is None else until
        stops: list[stop_base] = [stop_when_event_set(stopping)]
        if retry_for_s is not None:
            stops.append(stop_after_delay(retry_for_s))
        sendings = Retrying(
            retry=retry_if_exception_type(_TryAgainError),
            wait=_pause,
            stop=lambda state: any(stop(state) for stop in stops),
            sleep=sleep_using_event(stopping),
        )
        try:
            for sending in sendings:
                with sending:
                    return self._sent(method, path, timeout=timeout, **options)
        except RetryError as error:
            reason = error.last_attempt.exception()
            raise UnreachableError(f"{method} {path}: {reason}") from error
        raise AssertionError("a sending ends in an answer or an error")

    def _sent(self, method: str, path: str, **options: Any) -> Any:
        try:
            answer = self._http.request(method, path, **options)
        except (httpx2.TransportError, httpx2.DecodingError) as error:
            log.info("api_unreachable", path=path, error=str(error) or type(error).__name__)
            raise _TryAgainError(str(error) or type(error).__name__) from error
        except RuntimeError as error:
            if not self._http.is_closed:
                raise
            raise UnreachableError("this runner has stopped") from error
        if answer.status_code in BUSY:
            asked = answer.headers.get("retry-after", "")
            raise _TryAgainError(_detail(answer), float(asked) if asked.isdecimal() else 0.0)
        if answer.status_code == GONE:
            raise LeaseLostError(_detail(answer))
        if not answer.is_success:
            raise RefusedError(answer.status_code, _detail(answer))
        if not answer.content:
            return None
        try:
            return answer.json()
        except ValueError as error:
            raise RefusedError(answer.status_code, f"{path} does not answer in JSON") from error


def _pause(state: RetryCallState) -> float:
    """Return the requested pause, with a random part so that runners do not retry together."""
    error = state.outcome.exception() if state.outcome else None
    asked = error.pause_s if isinstance(error, _TryAgainError) else 0.0
    chance = wait_random_exponential(multiplier=0.25, max=LONGEST_PAUSE_S)(state)
    return min(asked, LONGEST_PAUSE_S) + chance


def _detail(answer: httpx2.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {answer.status_code}"
