"""Waiting for a trial: polls of the database for runners."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from cachetools import LRUCache, TTLCache
from fastapi.concurrency import run_in_threadpool

from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_backend.errors import PermanentError, StaleLeaseError
from buildarena_backend.leases.leases import Lease
from buildarena_backend.leases.runner_leases import prefix_of
from buildarena_backend.process.context import Context
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.trial_repository import DueTrial, TrialRepository

LOOK_EVERY_S: Final = 0.3
"""Interval between looks at the queues for all runners of one process with equal requests."""
MAX_QUERIES: Final = 1000
MAX_LEASES: Final = 64
"""Leases that one key's runners may have at once."""
MAX_NAMES: Final = 128
"""Names that one key's runners may have within a minute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseQuery:
    """Trials that a runner can take.

    Attributes:
        simulators: The simulators that it has, each with its version.
        job_owners: The keys whose jobs it may lease; None for all.
    """

    simulators: tuple[tuple[str, str], ...]
    job_owners: tuple[str, ...] | None


LeaseGrant = tuple[Lease, DueTrial]
"""A lease, and the trial that is to be run under it."""


class LeaseQueue:
    """Finds trials for runners."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._trials = TrialRepository(context)
        # One look at a time, and not too often for equal requests.
        self._looking = asyncio.Lock()
        self._nothing: TTLCache[LeaseQuery, bool] = TTLCache(MAX_QUERIES, LOOK_EVERY_S)
        self._last_owner: LRUCache[LeaseQuery, str] = LRUCache(MAX_QUERIES)

    async def grant(
        self,
        lease_request: LeaseQuery,
        *,
        owner: str,
        prefix: str,
        wait_s: float,
        left: Callable[[], Awaitable[bool]],
    ) -> LeaseGrant | None:
        """Return the next trial that fits a lease request, once there is one; None if none came.

        Args:
            owner: The runner, as leases and attempts name it.
            prefix: That of its key's runners.
            left: Whether the runner has left meanwhile: nothing is leased to it then.

        Raises:
            ProblemError: 429, when the key's runners have as many leases as they may.
        """
        lease = await run_in_threadpool(self._again, owner, prefix)
        if lease is not None:
            return lease
        loop = asyncio.get_running_loop()
        deadline = loop.time() + wait_s
        while True:
            async with self._looking:
                if wait_s and await left():
                    return None
                if not wait_s or lease_request not in self._nothing:
                    leased = await run_in_threadpool(self._next, lease_request, owner)
                    if leased is not None:
                        return leased
                    self._nothing[lease_request] = True
            if loop.time() >= deadline:
                return None
            await asyncio.sleep(min(LOOK_EVERY_S, max(0.01, deadline - loop.time())))

    def _again(self, owner: str, prefix: str) -> LeaseGrant | None:
        """Return the lease that this runner has already, if the answer with it was lost."""
        leases = self._context.store.runner_leases
        held = leases.of(owner)
        if held is not None:
            return self._due(held)
        counts = leases.counts(prefix, besides=owner)
        if counts["leases"] >= MAX_LEASES or counts["names"] >= MAX_NAMES:
            raise ProblemError(
                ErrorCode.TOO_MANY_OPEN,
                f"the key's runners have {counts['leases']} leases and {counts['names']} names, "
                f"of {MAX_LEASES} and {MAX_NAMES} that they may have",
                headers={"Retry-After": "5"},
            )
        return None

    def _next(self, lease_request: LeaseQuery, owner: str) -> LeaseGrant | None:
        for simulator, version in lease_request.simulators:
            while (lease := self._claim(lease_request, owner, simulator, version)) is not None:
                if (leased := self._due(lease)) is not None:
                    return leased
        return None

    def _claim(
        self, lease_request: LeaseQuery, owner: str, simulator: str, version: str
    ) -> Lease | None:
        lease = self._context.store.leases.claim(
            simulate_queue(simulator),
            owner=owner,
            last=self._last_owner.get(lease_request),
            only=lease_request.job_owners,
            version=version,
            prefix=prefix_of(owner),
            max_leases=MAX_LEASES,
        )
        if lease is not None:
            self._last_owner[lease_request] = lease.job.owner or ""
        return lease

    def _due(self, lease: Lease) -> LeaseGrant | None:
        """Return the trial of a lease; None when it needs none, as its job ended or moved on."""
        try:
            due = self._trials.due(lease.job)
            return None if self._trials.repeat(lease, due) else (lease, due)
        except StaleLeaseError:
            return None
        except PermanentError as error:
            self._context.store.leases.give_up(lease, str(error), reason=error.reason)
            return None
        except Exception:
            # The caller gets an error: the job must not wait for this lease's end.
            self._context.store.leases.hand_back(lease)
            raise
