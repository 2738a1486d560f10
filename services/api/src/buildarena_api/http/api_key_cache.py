"""Validity of keys, queried at most once in half a second per key."""

from __future__ import annotations

from typing import Final

from anyio import CapacityLimiter, to_thread
from cachetools import TTLCache

from buildarena_backend.accounts.keys import ApiKeys, KeyCheck, is_secret, secret_hash

CACHED_S: Final = 0.5
"""Lifetime of a cached answer, and so of a key that was revoked elsewhere."""
KNOWN_S: Final = 60.0
"""Time for which a valid key names its holder in counts before the check."""
MAX_CACHED: Final = 10_000
AT_ONCE: Final = 2
"""Concurrent look-ups: the maximum of connections that any number of invented keys uses."""


class ApiKeyVerifier:
    """Checks secrets, two at once; texts without the form of a secret are not looked up."""

    def __init__(self, keys: ApiKeys) -> None:
        self._keys = keys
        self._checked: TTLCache[str, KeyCheck | None] = TTLCache(MAX_CACHED, CACHED_S)
        self._holders: TTLCache[str, str] = TTLCache(MAX_CACHED, KNOWN_S)
        self._turns, self._threads = CapacityLimiter(AT_ONCE), CapacityLimiter(AT_ONCE)

    async def check(self, secret: str) -> KeyCheck | None:
        """Return the key with this secret, and whether it is valid; None if there is none."""
        if not is_secret(secret):
            return None
        digest = secret_hash(secret)
        if digest in self._checked:
            return self._checked[digest]
        async with self._turns:
            # A caller that waited with the same key uses its answer.
            if digest in self._checked:
                return self._checked[digest]
            result = await to_thread.run_sync(self._keys.check, secret, limiter=self._threads)
            self._checked[digest] = result
        self._holders.pop(digest, None)
        if result is not None and result.refusal is None:
            self._holders[digest] = result.key.id
        return result

    def known(self, secret: str) -> str | None:
        """Return the key's id if it was valid in the last minute; never queries the database."""
        return self._holders.get(secret_hash(secret))

    def forget(self) -> None:
        """Forget all answers: a key was changed."""
        self._checked.clear()
