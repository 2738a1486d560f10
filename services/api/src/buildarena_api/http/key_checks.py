"""Whether keys are good: asked of the database once for requests that come at the same time."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from typing import Final

from buildarena_api.http.own_pool import OwnPool
from buildarena_store import KeyCheck
from buildarena_store.accounts.keys import secret_hash

CACHED_S: Final = 0.5
"""How long an answer is used again: so long a key that was revoked elsewhere may still work."""
MAX_CACHED: Final = 10_000


class KeyChecks:
    """Checks secrets without taking the threads and connections of ordinary requests.

    Args:
        pool: What it asks with.
    """

    def __init__(self, pool: OwnPool) -> None:
        self._pool = pool
        self._kept: OrderedDict[str, tuple[float, KeyCheck | None]] = OrderedDict()
        self._asking: dict[str, asyncio.Task[KeyCheck | None]] = {}

    async def check(self, secret: str) -> KeyCheck | None:
        """The key that has this secret, and whether it is still good; None when nobody has it."""
        digest = secret_hash(secret)
        kept = self._kept.get(digest)
        if kept is not None and asyncio.get_running_loop().time() - kept[0] < CACHED_S:
            return kept[1]
        asking = self._asking.get(digest)
        if asking is None:
            asking = asyncio.create_task(self._ask(digest, secret))
            self._asking[digest] = asking
            asking.add_done_callback(lambda _: self._asking.pop(digest, None))
        # One that leaves must not end the question of the others.
        return await asyncio.shield(asking)

    def forget(self) -> None:
        """Asks the database again for every key: one was changed."""
        self._kept.clear()

    async def _ask(self, digest: str, secret: str) -> KeyCheck | None:
        asked_at = asyncio.get_running_loop().time()
        found = await self._pool.run(self._pool.context.store.keys.check, secret)
        self._kept[digest] = (asked_at, found)
        while len(self._kept) > MAX_CACHED:
            self._kept.popitem(last=False)
        return found
