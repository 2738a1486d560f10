"""Clients of models: behind a provider's HTTP API, or built in.

All requests of a process run on one event loop in a separate thread; sessions, which are plain
threads, wait for their answers.
"""

import asyncio
import math
import os
import random
import threading
import time
from collections.abc import Coroutine, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import structlog

from buildarena_backend.catalog.models import (
    BUILTIN_PROTOCOL,
    ModelEntry,
    ModelRegistry,
    ProviderEntry,
)
from buildarena_backend.catalog.prices import price_usd
from buildarena_backend.errors import PermanentError, TransientError
from buildarena_backend.journal.journal import GARBAGE, OUT_OF_TIME, Usage
from buildarena_backend.secret_files import SUFFIX, SecretFileError, read_secret
from buildarena_backend.telemetry.tracing import ERROR_TYPE, note
from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.providers.failures import Failure, ProviderError
from buildarena_worker.providers.registry import sender_for
from buildarena_worker.providers.throttle import Throttle
from buildarena_worker.session.messages import (
    UNBOUNDED,
    Completion,
    ModelClient,
    Request,
    RequestOptions,
)

log = structlog.get_logger(__name__)

OUTAGE_DELAY_S = 30.0
"""Delay of a job after its provider failed through all retries."""
OWN_FAILURES = frozenset({Failure.CONTEXT_OVERFLOW, Failure.CONTENT_FILTER})
"""Failures of the model: they are scored and not retried."""

Result = TypeVar("Result")


class RequestLoop:
    """An event loop in a separate thread, started by the first thread that needs it."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        # Sessions start all at once. Without the lock several of them create a loop, and clients
        # fail because their locks belong to another loop.
        self._starting = threading.Lock()

    def run(self, work: Coroutine[Any, Any, Result], options: RequestOptions = UNBOUNDED) -> Result:
        """Return the result of work on the loop; the calling thread waits for it.

        Raises:
            CancelledError: The lease was lost, which ends the work at once; or the worker stops
                and nothing had been sent yet.
        """
        loop, active = self._started(), options.active
        if active is None:
            return asyncio.run_coroutine_threadsafe(work, loop).result()
        begun: asyncio.Future[asyncio.Task[Result]] = asyncio.Future(loop=loop)

        async def run() -> Result:
            task = asyncio.ensure_future(work)
            begun.set_result(task)
            return await task

        async def give_up() -> None:
            # On the loop, nothing can be sent between the check and the cancellation.
            task = await begun
            if active.lost or not options.sent.is_set():
                task.cancel()

        future = asyncio.run_coroutine_threadsafe(run(), loop)
        with active.calling(lambda: asyncio.run_coroutine_threadsafe(give_up(), loop)):
            return future.result()

    def _started(self) -> asyncio.AbstractEventLoop:
        with self._starting:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(
                    target=self._loop.run_forever, name="model-requests", daemon=True
                ).start()
            return self._loop


REQUESTS = RequestLoop()


@dataclass(frozen=True, slots=True, kw_only=True)
class RetryPolicy:
    """Retry limits of a request.

    Attributes:
        attempts: Maximum number of attempts.
        first_wait_s: Longest wait after the first failure; doubles with each.
        longest_wait_s: Longest wait, even if a provider requests a longer one.
        timeout_s: Timeout of one attempt, connection included.
    """

    attempts: int = 6
    first_wait_s: float = 1.0
    longest_wait_s: float = 60.0
    timeout_s: float = 600.0

    def wait_s(self, failures: int, headers: Mapping[str, str] | None, rng: random.Random) -> float:
        """Return the wait after this many failures, seconds.

        The provider's Retry-After takes precedence over a random part of a doubling wait, which
        spreads the workers' retries.
        """
        requested = _retry_after(headers)
        if requested is not None:
            return min(requested, self.longest_wait_s)
        ceiling = min(self.longest_wait_s, self.first_wait_s * 2 ** (failures - 1))
        return rng.uniform(ceiling / 2, ceiling)


class ProviderClient:
    """Client of one model of one provider.

    Args:
        policy: Limits of retries; by default with the provider's timeout.
        throttle: The provider's shared limit of open requests; none by default.
    """

    def __init__(
        self,
        entry: ModelEntry,
        provider: ProviderEntry,
        policy: RetryPolicy | None = None,
        throttle: Throttle | None = None,
    ) -> None:
        self._throttle = throttle or Throttle(None, entry.provider)
        self._entry = entry
        self._policy = policy or RetryPolicy(timeout_s=provider.timeout_s)
        key = _key_of(entry, provider)
        self._secrets = tuple(filter(None, (provider.key and key, *provider.headers.values())))
        self._sender = sender_for(entry, provider, key)
        self._rng = random.Random()  # noqa: S311 - spreads retries, guards nothing

    def complete(self, request: Request, options: RequestOptions = UNBOUNDED) -> Completion:
        """Request a completion, with the policy's retries.

        Raises:
            CancelledError: The lease was lost, or its worker stops and nothing was sent.
            TransientError: The provider failed through all attempts.
            PermanentError: The provider refuses the key, the model or the account.
        """
        return REQUESTS.run(self._in_time(request, options), options)

    def close(self) -> None:
        """Close the connections to the provider."""

        async def close() -> None:
            await self._sender.close()
            await self._throttle.close()

        REQUESTS.run(close())

    async def _in_time(self, request: Request, options: RequestOptions) -> Completion:
        started, within_s = time.monotonic(), options.within_s
        try:
            async with asyncio.timeout(within_s if math.isfinite(within_s) else None):
                return await self._complete(request, options)
        except TimeoutError:
            detail = f"the job's time was over after {within_s:.3g} s"
            return _failed(OUT_OF_TIME, detail, started, text=detail)

    async def _complete(self, request: Request, options: RequestOptions) -> Completion:
        started, failures = time.monotonic(), list[str]()
        for attempts in range(1, self._policy.attempts + 1):
            try:
                completion = await self._send(request, options)
            except ProviderError as error:
                failure = error.failure
                detail = without_secrets(_first_line(error), self._secrets)
                if failure in OWN_FAILURES:
                    return _failed(failure.value, detail, started, text="", attempts=attempts)
                if failure is Failure.GARBAGE:
                    fields = {"attempts": attempts, "usage": self._priced(error.usage)}
                    return _failed(GARBAGE, detail, started, text=detail, **fields)
                if failure is not Failure.OUTAGE:
                    message = f"{self._entry.name}: {detail}"
                    raise PermanentError(message, reason=failure.value) from error
                if attempts == self._policy.attempts:
                    raise TransientError(
                        f"{self._entry.name}: {attempts} attempts failed, the last: {detail}",
                        reason="provider_outage",
                        delay_s=OUTAGE_DELAY_S,
                    ) from error
                wait_s = self._policy.wait_s(attempts, error.headers, self._rng)
                if options.active is not None and options.active.draining:
                    raise asyncio.CancelledError from error  # no retries after the stop
                note("retry", {ERROR_TYPE: failure.value, "buildarena.wait_s": wait_s})
                log.info("model_retry", model=self._entry.name, attempts=attempts, wait_s=wait_s)
                failures.append(detail)
                await asyncio.sleep(wait_s)
            else:
                hide = partial(without_secrets, secrets=self._secrets)
                return replace(
                    completion,
                    text=hide(completion.text),
                    calls=[
                        replace(call, name=hide(call.name), arguments=hide(call.arguments))
                        for call in completion.calls
                    ],
                    failures=failures,
                    usage=self._priced(completion.usage),
                    latency_s=time.monotonic() - started,
                    attempts=attempts,
                )
        raise AssertionError("the last attempt returns or raises")

    async def _send(self, request: Request, options: RequestOptions) -> Completion:
        """Send a request once, when the provider's shared limit lets it."""
        async with self._throttle.slot(options.owner) as slot:
            options.sent.set()
            try:
                async with asyncio.timeout(self._policy.timeout_s):
                    completion = await self._sender.send(request)
            except TimeoutError as error:
                raise ProviderError(type(error).__name__, Failure.OUTAGE) from error
            except ProviderError as error:
                options.sent.clear()
                if error.overloaded:
                    slot.verdict = "shrink"
                raise
            slot.verdict = "grow"
            return completion

    def _priced(self, usage: Usage) -> Usage:
        tokens = usage.input_tokens, usage.output_tokens, usage.cached_tokens
        return replace(usage, cost_usd=price_usd(self._entry, *tokens))


class ModelClients:
    """Cache of one client per model, safe to use from many threads.

    Args:
        throttle_url: URL of the store of the providers' shared limits; None for no limits.
    """

    def __init__(self, registry: ModelRegistry, throttle_url: str | None = None) -> None:
        self._registry = registry
        self._throttle_url = throttle_url
        self._clients: dict[str, tuple[ModelEntry, ProviderEntry, ModelClient]] = {}
        self._lock = threading.Lock()

    def for_config(self, model_config: Mapping[str, Any]) -> ModelClient:
        """Return the client for a job's model.

        Raises:
            PermanentError: The operator's registry lacks the model, or its key is not set.
        """
        name = str(model_config["name"])
        entry = self._registry.models.get(name)
        if entry is None:
            raise PermanentError(
                f"this worker's model registry lacks {name!r}", reason="unknown_model"
            )
        provider = self._registry.provider_of(entry)
        with self._lock:
            known = self._clients.get(name)
            if known is None or known[:2] != (entry, provider):
                # Sessions that began with another entry keep their client.
                known = self._clients[name] = entry, provider, self._make(entry, provider)
            return known[2]

    def _make(self, entry: ModelEntry, provider: ProviderEntry) -> ModelClient:
        if provider.protocol == BUILTIN_PROTOCOL:
            return BuiltinClient(entry.model)
        throttle = Throttle(self._throttle_url, entry.provider, maximum=provider.concurrency)
        return ProviderClient(entry, provider, throttle=throttle)


def _retry_after(headers: Mapping[str, str] | None) -> float | None:
    for name, scale in (("retry-after-ms", 0.001), ("retry-after", 1.0)):
        with suppress(KeyError, ValueError):
            return max(0.0, float((headers or {})[name]) * scale)
    return None


def _key_of(entry: ModelEntry, provider: ProviderEntry) -> str:
    """Return the provider's API key, from the environment or a file; a provider may need none."""
    if provider.key is None:
        return "none"
    try:
        key = read_secret(provider.key, os.environ)
    except SecretFileError as error:
        raise PermanentError(f"{entry.name}: {error}", reason="missing_key") from error
    if key is None:
        raise PermanentError(
            f"{entry.name} needs the API key in {provider.key} or {provider.key}{SUFFIX}, "
            "which is not set on the worker",
            reason="missing_key",
        )
    return key


def _failed(finish: str, detail: str, started: float, **fields: Any) -> Completion:
    """Return the completion of a request that failed."""
    log.info("model_failure", finish=finish, detail=detail)
    return Completion(finish=finish, latency_s=time.monotonic() - started, **fields)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:500]


def without_secrets(value: Any, secrets: Sequence[str]) -> Any:
    """Return a JSON value without the secrets that some providers repeat."""
    if isinstance(value, str):
        for secret in secrets:
            value = value.replace(secret, "***")
        return value
    if isinstance(value, dict):
        return {
            without_secrets(name, secrets): without_secrets(inner, secrets)
            for name, inner in value.items()
        }
    if isinstance(value, list | tuple):
        return [without_secrets(inner, secrets) for inner in value]
    return value
