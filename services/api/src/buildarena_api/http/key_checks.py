"""Whether keys are good: asked of the database once for requests that come at the same time."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from typing import Final, TypeVar

from buildarena_api.http.own_pool import OwnPool
from buildarena_store import KeyCheck
from buildarena_store.accounts.keys import is_secret, secret_hash

CACHED_S: Final = 0.5
"""How long an answer is used again: so long a key that was revoked elsewhere may still work."""
KNOWN_S: Final = 60.0
"""How long a key that was good counts as its holder's, for what is counted before it is checked."""
MAX_CACHED: Final = 10_000

T = TypeVar("T")


class KeyChecks:
    """Checks secrets without taking the threads and connections of ordinary requests.

    One question is asked of the database at a time, for all secrets that came meanwhile: whoever
    sends invented keys, however many, costs the others one connection. What does not have the form
    of a secret costs none.

    Args:
        pool: What it asks with.
    """

    def __init__(self, pool: OwnPool) -> None:
        self._pool = pool
        self._checked: OrderedDict[str, tuple[float, KeyCheck | None]] = OrderedDict()
        self._good: OrderedDict[str, tuple[float, str]] = OrderedDict()
        self._waiting: dict[str, asyncio.Future[KeyCheck | None]] = {}
        self._asking: asyncio.Task[None] | None = None

    async def check(self, secret: str) -> KeyCheck | None:
        """The key that has this secret, and whether it is still good; None when nobody has it."""
        if not is_secret(secret):
            return None
        digest, loop = secret_hash(secret), asyncio.get_running_loop()
        checked = self._checked.get(digest)
        if checked is not None and loop.time() - checked[0] < CACHED_S:
            return checked[1]
        waiting = self._waiting.get(digest)
        if waiting is None:
            waiting = self._waiting[digest] = loop.create_future()
        if self._asking is None or self._asking.done():
            self._asking = asyncio.create_task(self._ask_all())
        # One that leaves must not end the question of the others.
        return await asyncio.shield(waiting)

    def known(self, secret: str) -> str | None:
        """Whose secret it is, if it was good within the last minute; nothing is asked."""
        seen = self._good.get(secret_hash(secret))
        if seen is None or asyncio.get_running_loop().time() - seen[0] > KNOWN_S:
            return None
        return seen[1]

    def forget(self) -> None:
        """Asks the database again for every key: one was changed."""
        self._checked.clear()

    async def _ask_all(self) -> None:
        while self._waiting:
            asked, self._waiting = self._waiting, {}
            asked_at = asyncio.get_running_loop().time()
            check = self._pool.context.store.keys.check_hashes
            try:
                checks = await self._pool.run(check, list(asked))
            except Exception as error:  # noqa: BLE001 - whoever asked gets it
                _answer(asked, error)
                continue
            for digest, waiting in asked.items():
                self._note(digest, asked_at, checks.get(digest))
                if not waiting.done():
                    waiting.set_result(checks.get(digest))

    def _note(self, digest: str, asked_at: float, check: KeyCheck | None) -> None:
        _put(self._checked, digest, (asked_at, check))
        if check is not None and check.refusal is None:
            _put(self._good, digest, (asked_at, check.key.id))
        else:
            self._good.pop(digest, None)


def _put(cache: OrderedDict[str, T], digest: str, value: T) -> None:
    cache[digest] = value
    cache.move_to_end(digest)
    while len(cache) > MAX_CACHED:
        cache.popitem(last=False)


def _answer(asked: dict[str, asyncio.Future[KeyCheck | None]], error: Exception) -> None:
    for waiting in asked.values():
        if not waiting.done():
            waiting.set_exception(error)
