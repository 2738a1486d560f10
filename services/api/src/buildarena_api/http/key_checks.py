"""Whether keys are good: asked of the database once for requests that come at the same time."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import Final, TypeVar

from buildarena_api.http.own_pool import OwnPool
from buildarena_backend.accounts.keys import KeyCheck, is_secret, secret_hash

CACHED_S: Final = 0.5
"""How long an answer is used again: so long a key that was revoked elsewhere may still work."""
KNOWN_S: Final = 60.0
"""How long a key that was good counts as its holder's, for what is counted before it is checked."""
MAX_CACHED: Final = 10_000
PAUSE_S: Final = 0.1
"""Between two questions for secrets that nobody is known to have: whoever invents keys, however
many and however fast, costs the database ten questions in a second; a new key waits so long at
most, once."""

T = TypeVar("T")


class KeyChecks:
    """Checks secrets without taking the threads and connections of ordinary requests.

    One question at a time is asked of the database for all secrets that came meanwhile: one for
    those that were good lately, and, ten times in a second at most, one for those that nobody is
    known to have. What does not have the form of a secret is not asked for.

    Args:
        pool: What it asks with.
    """

    def __init__(self, pool: OwnPool) -> None:
        self._pool = pool
        self._checked: OrderedDict[str, tuple[float, KeyCheck | None]] = OrderedDict()
        self._good: OrderedDict[str, tuple[float, str]] = OrderedDict()
        self._of_known = _Questions(self._ask, pause_s=0.0)
        self._of_unknown = _Questions(self._ask, pause_s=PAUSE_S)

    async def check(self, secret: str) -> KeyCheck | None:
        """The key that has this secret, and whether it is still good; None when nobody has it."""
        if not is_secret(secret):
            return None
        digest, loop = secret_hash(secret), asyncio.get_running_loop()
        checked = self._checked.get(digest)
        if checked is not None and loop.time() - checked[0] < CACHED_S:
            return checked[1]
        questions = self._of_unknown if self.known(secret) is None else self._of_known
        return await questions.answer(digest)

    def known(self, secret: str) -> str | None:
        """Whose secret it is, if it was good within the last minute; nothing is asked."""
        seen = self._good.get(secret_hash(secret))
        if seen is None or asyncio.get_running_loop().time() - seen[0] > KNOWN_S:
            return None
        return seen[1]

    def forget(self) -> None:
        """Asks the database again for every key: one was changed."""
        self._checked.clear()

    async def _ask(self, digests: list[str]) -> dict[str, KeyCheck]:
        asked_at = asyncio.get_running_loop().time()
        checks = await self._pool.run(self._pool.context.store.keys.check_hashes, digests)
        for digest in digests:
            self._note(digest, asked_at, checks.get(digest))
        return checks

    def _note(self, digest: str, asked_at: float, check: KeyCheck | None) -> None:
        _put(self._checked, digest, (asked_at, check))
        if check is not None and check.refusal is None:
            _put(self._good, digest, (asked_at, check.key.id))
        else:
            self._good.pop(digest, None)


class _Questions:
    """Asks one question at a time, for all that came while the one before was answered.

    Args:
        ask: Asks for many.
        pause_s: How long after an answer the next question is asked at the earliest.
    """

    def __init__(
        self, ask: Callable[[list[str]], Awaitable[dict[str, KeyCheck]]], *, pause_s: float
    ) -> None:
        self._ask = ask
        self._pause_s = pause_s
        self._waiting: dict[str, asyncio.Future[KeyCheck | None]] = {}
        self._asking: asyncio.Task[None] | None = None

    async def answer(self, digest: str) -> KeyCheck | None:
        """What is known of one."""
        waiting = self._waiting.get(digest)
        if waiting is None:
            waiting = self._waiting[digest] = asyncio.get_running_loop().create_future()
        if self._asking is None or self._asking.done():
            self._asking = asyncio.create_task(self._ask_all())
        # One that leaves must not end the question of the others.
        return await asyncio.shield(waiting)

    async def _ask_all(self) -> None:
        while self._waiting:
            asked, self._waiting = self._waiting, {}
            try:
                checks = await self._ask(list(asked))
            except Exception as error:  # noqa: BLE001 - whoever asked gets it
                _answer(asked, error)
            else:
                for digest, waiting in asked.items():
                    if not waiting.done():
                        waiting.set_result(checks.get(digest))
            await asyncio.sleep(self._pause_s)


def _put(cache: OrderedDict[str, T], digest: str, value: T) -> None:
    cache[digest] = value
    cache.move_to_end(digest)
    while len(cache) > MAX_CACHED:
        cache.popitem(last=False)


def _answer(asked: dict[str, asyncio.Future[KeyCheck | None]], error: Exception) -> None:
    for waiting in asked.values():
        if not waiting.done():
            waiting.set_exception(error)
