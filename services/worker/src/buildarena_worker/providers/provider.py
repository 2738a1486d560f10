"""Models behind a provider's HTTP API.

All requests of a process run on one event loop in a thread of its own; sessions, which are plain
threads, wait for their answers there.
"""

from __future__ import annotations

import asyncio
import math
import os
import random
import time

import structlog

from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_pipeline.catalog.prices import price_usd
from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_pipeline.secret_files import SUFFIX, SecretFileError, read_secret
from buildarena_store import Usage
from buildarena_store.jobs.journal import GARBAGE, OUT_OF_TIME
from buildarena_worker.providers.answered import Answered, TokenCounts
from buildarena_worker.providers.failures import Failure, ProviderError
from buildarena_worker.providers.request_loop import RequestLoop
from buildarena_worker.providers.retries import RetryPolicy
from buildarena_worker.providers.senders import sender_for
from buildarena_worker.providers.throttle import Throttle
from buildarena_worker.session.messages import Answer, Reply, Request
from buildarena_worker.session.patience import ENDLESS, Patience

log = structlog.get_logger(__name__)

OUTAGE_DELAY_S = 30.0
"""How long a job waits after its provider failed through all retries."""
OWN_FAILURES = frozenset({Failure.CONTEXT_OVERFLOW, Failure.CONTENT_FILTER})
"""Failures that count as the model's: it is scored for them, and they are not retried."""

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
        self._key = _key_of(entry, provider)
        self._sender = sender_for(entry, provider, self._key)
        self._rng = random.Random()  # noqa: S311 - spreads retries, guards nothing

    def complete(self, request: Request, patience: Patience = ENDLESS) -> Answer:
        """Asks the model, with the policy's retries.

        Args:
            request: What is asked.
            patience: How long to wait, with all retries.

        Raises:
            CancelledError: The lease was lost.
            TransientError: The provider failed through all tries.
            PermanentError: The provider refuses the key, the model or the account.
        """
        return REQUESTS.run(self._in_time(request, patience), patience.active)

    def close(self) -> None:
        """Closes the connections to the provider."""

        async def close() -> None:
            await self._sender.close()
            await self._throttle.close()

        REQUESTS.run(close())

    async def _in_time(self, request: Request, patience: Patience) -> Answer:
        started, within_s = time.monotonic(), patience.within_s
        try:
            async with asyncio.timeout(within_s if math.isfinite(within_s) else None):
                return await self._complete(request, patience)
        except TimeoutError:
            detail = f"the job's time was over after {within_s:.3g} s"
            return _empty(OUT_OF_TIME, detail, time.monotonic() - started, 1)

    async def _complete(self, request: Request, patience: Patience) -> Answer:
        started = time.monotonic()
        for tries in range(1, self._policy.tries + 1):
            try:
                answered = await self._send(request, patience)
            except (ProviderError, TimeoutError) as error:
                failure = error.failure if isinstance(error, ProviderError) else Failure.OUTAGE
                detail = _first_line(error, self._key)
                latency_s = time.monotonic() - started
                if failure in OWN_FAILURES:
                    return _empty(failure.value, "", latency_s, tries, detail=detail)
                if isinstance(error, ProviderError) and failure is Failure.GARBAGE:
                    usage = self._usage(error.tokens)
                    return _empty(GARBAGE, detail, latency_s, tries, usage=usage)
                if failure is not Failure.OUTAGE:
                    message = f"{self._entry.name}: {detail}"
                    raise PermanentError(message, reason=failure.value) from error
                if tries == self._policy.tries:
                    raise TransientError(
                        f"{self._entry.name}: {tries} tries failed, the last: {detail}",
                        reason="provider_outage",
                        delay_s=OUTAGE_DELAY_S,
                    ) from error
                headers = error.headers if isinstance(error, ProviderError) else None
                wait_s = self._policy.wait_s(tries, headers, self._rng)
                log.info("model_retry", model=self._entry.name, tries=tries, wait_s=wait_s)
                await asyncio.sleep(wait_s)
            else:
                return self._answer(answered, time.monotonic() - started, tries)
        raise AssertionError("the last try returns or raises")

    async def _send(self, request: Request, patience: Patience) -> Answered:
        """Sends a request once, when the provider's shared limit lets it."""
        async with self._throttle.slot(patience.owner) as slot:
            patience.sent.set()
            try:
                async with asyncio.timeout(self._policy.timeout_s):
                    answered = await self._sender.send(request)
            except ProviderError as error:
                patience.sent.clear()
                if error.overloaded:
                    slot.rejected()
                raise
            slot.succeeded()
            return answered

    def _answer(self, answered: Answered, latency_s: float, tries: int) -> Answer:
        return Answer(
            reply=answered.reply,
            usage=self._usage(answered.tokens),
            latency_s=latency_s,
            tries=tries,
            provider_request_id=answered.response_id,
        )

    def _usage(self, tokens: TokenCounts) -> Usage:
        return Usage(
            requests=1,
            input_tokens=tokens.input,
            output_tokens=tokens.output,
            cached_tokens=tokens.cached,
            reasoning_tokens=tokens.reasoning,
            cost_usd=price_usd(
                self._entry,
                input_tokens=tokens.input,
                output_tokens=tokens.output,
                cached_tokens=tokens.cached,
            ),
        )


def _key_of(entry: ModelEntry, provider: ProviderEntry) -> str:
    """The provider's API key, from the environment or a file; a provider may need none."""
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


def _empty(
    finish: str,
    text: str,
    latency_s: float,
    tries: int,
    *,
    usage: Usage = Usage(requests=1),  # noqa: B008 - frozen
    detail: str | None = None,
) -> Answer:
    """An answer without a reply that a session could go on with."""
    log.info("model_failure", finish=finish, detail=detail or text)
    return Answer(
        reply=Reply(text=text, finish=finish), usage=usage, latency_s=latency_s, tries=tries
    )


def _first_line(error: Exception, key: str) -> str:
    """What an error says, without the API key, which some providers repeat."""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return line.replace(key, "***")[:500]
