"""Models behind a provider's HTTP API.

All requests of a process run on one event loop in a thread of its own; sessions, which are plain
threads, wait for their answers there.
"""

from __future__ import annotations

import asyncio
import os
import random
import time
from collections.abc import Mapping
from typing import Any

import structlog
from pydantic_ai.exceptions import (
    ContentFilterError,
    ModelAuthenticationError,
    ModelContextWindowExceededError,
    ModelHTTPError,
    ModelNotFoundError,
    ModelOverloadedError,
    ModelQuotaExceededError,
    ModelRateLimitError,
)
from pydantic_ai.settings import ModelSettings

from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_pipeline.catalog.prices import price_usd
from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_store import Usage
from buildarena_worker.providers.request_loop import RequestLoop
from buildarena_worker.providers.retries import RetryPolicy
from buildarena_worker.providers.senders import sender_for
from buildarena_worker.providers.throttle import Throttle
from buildarena_worker.providers.wire import Answered
from buildarena_worker.session.messages import Answer, Reply, Request

log = structlog.get_logger(__name__)

OUTAGE_DELAY_S = 30.0
"""How long a job waits after its provider failed through all retries."""
RETRIED_STATUS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 520, 522, 524, 529})


REQUESTS = RequestLoop()


class ProviderClient:
    """Asks one model of one provider.

    Args:
        entry: The model.
        provider: How its provider is reached.
        policy: How often and how long to try.
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
        self._policy = policy or RetryPolicy()
        self._wire = provider.wire
        self._key = _key_of(entry, provider)
        self._sender = sender_for(entry, provider, self._key)
        self._rng = random.Random()  # noqa: S311 - spreads retries, guards nothing

    def complete(self, request: Request) -> Answer:
        """Asks the model, with the policy's retries.

        Raises:
            TransientError: The provider failed through all tries.
            PermanentError: The provider refuses the key, the model or the account.
        """
        return REQUESTS.run(self._complete(request))

    def close(self) -> None:
        """Closes the connections to the provider."""

        async def close() -> None:
            await self._sender.close()
            await self._throttle.close()

        REQUESTS.run(close())

    async def _complete(self, request: Request) -> Answer:
        started = time.monotonic()
        for tries in range(1, self._policy.tries + 1):
            try:
                answered = await self._send(request)
            except ModelContextWindowExceededError as error:
                return _own_failure("context_overflow", str(error), started, tries)
            except ContentFilterError as error:
                return _own_failure("content_filter", str(error), started, tries)
            except Exception as error:
                _raise_if_permanent(error, self._entry, self._key)
                if tries == self._policy.tries:
                    raise TransientError(
                        f"{self._entry.name}: {tries} tries failed, the last with "
                        f"{type(error).__name__}: {_first_line(error, self._key)}",
                        reason="provider_outage",
                        delay_s=OUTAGE_DELAY_S,
                    ) from error
                wait_s = self._policy.wait_s(tries, _headers(error), self._rng)
                log.info("model_retry", model=self._entry.name, tries=tries, wait_s=wait_s)
                await asyncio.sleep(wait_s)
            else:
                return self._answer(answered, time.monotonic() - started, tries)
        raise AssertionError("the last try returns or raises")

    async def _send(self, request: Request) -> Answered:
        """Sends a request once, when the provider's shared limit lets it."""
        async with self._throttle.slot() as slot:
            try:
                async with asyncio.timeout(self._policy.timeout_s):
                    answered = await self._sender.send(
                        request.messages, request.tools, self._settings(request)
                    )
            except (ModelRateLimitError, ModelOverloadedError):
                slot.was_too_much()
                raise
            slot.went_well()
            return answered

    def _settings(self, request: Request) -> ModelSettings:
        decoding: Mapping[str, Any] = request.model_config["decoding"]
        settings = ModelSettings(seed=request.seed)
        if "temperature" in decoding:
            settings["temperature"] = decoding["temperature"]
        if "top_p" in decoding:
            settings["top_p"] = decoding["top_p"]
        if "max_tokens" in decoding:
            settings["max_tokens"] = decoding["max_tokens"]
        if request.tools and self._wire != "google":  # Google has no such setting
            settings["parallel_tool_calls"] = False
        return settings

    def _answer(self, answered: Answered, latency_s: float, tries: int) -> Answer:
        used = answered.usage
        reasoning = int(used.details.get("reasoning_tokens", 0)) if used.details else 0
        cost = price_usd(
            self._entry,
            input_tokens=used.input_tokens,
            output_tokens=used.output_tokens,
            cached_tokens=used.cache_read_tokens,
        )
        usage = Usage(
            requests=1,
            input_tokens=used.input_tokens,
            output_tokens=used.output_tokens,
            cached_tokens=used.cache_read_tokens,
            reasoning_tokens=reasoning,
            cost_usd=cost,
        )
        return Answer(
            reply=answered.reply,
            usage=usage,
            latency_s=latency_s,
            tries=tries,
            provider_request_id=answered.response_id,
        )


def _key_of(entry: ModelEntry, provider: ProviderEntry) -> str:
    """The provider's API key, from the environment; a provider may need none."""
    key = "none" if provider.key is None else os.environ.get(provider.key, "")
    if not key:
        raise PermanentError(
            f"{entry.name} needs the API key in {provider.key}, which is not set on the worker",
            reason="missing_key",
        )
    return key


def _own_failure(finish: str, detail: str, started: float, tries: int) -> Answer:
    reply = Reply(text="", finish=finish)
    log.info("model_failure", finish=finish, detail=detail.splitlines()[0] if detail else "")
    return Answer(
        reply=reply, usage=Usage(requests=1), latency_s=time.monotonic() - started, tries=tries
    )


def _raise_if_permanent(error: Exception, entry: ModelEntry, key: str) -> None:
    reasons: tuple[tuple[type[Exception], str], ...] = (
        (ModelAuthenticationError, "bad_credentials"),
        (ModelNotFoundError, "model_not_found"),
        (ModelQuotaExceededError, "quota_exceeded"),
    )
    for kind, reason in reasons:
        if isinstance(error, kind):
            raise PermanentError(
                f"{entry.name}: {_first_line(error, key)}", reason=reason
            ) from error
    if isinstance(error, ModelHTTPError) and error.status_code not in RETRIED_STATUS:
        raise PermanentError(
            f"{entry.name}: HTTP {error.status_code}: {_first_line(error, key)}",
            reason="request_refused",
        ) from error


def _headers(error: Exception) -> Mapping[str, str] | None:
    return error.headers if isinstance(error, ModelHTTPError) else None


def _first_line(error: Exception, key: str) -> str:
    """What an error says, without the API key, which some providers repeat."""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return line.replace(key, "***")[:500]
