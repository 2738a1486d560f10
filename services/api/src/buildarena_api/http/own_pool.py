"""Threads and database connections for one kind of work, which takes none of the others'."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import ParamSpec, TypeVar

from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.database.database import Database
from buildarena_backend.process.context import Context
from buildarena_backend.store import open_store

POOL_TIMEOUT_S = 2.0
"""How long a request waits for a database connection before it is answered with 503."""

P = ParamSpec("P")
T = TypeVar("T")


class OwnPool:
    """A pool beside those of ordinary requests.

    Args:
        context: The process' connections.
        size: Threads, and database connections.
        name: What the threads are called.

    Attributes:
        context: The same with this pool's database connections.
    """

    def __init__(self, context: Context, *, size: int, name: str) -> None:
        settings = context.settings
        database = Database(
            settings.required_database_url(),
            pool_size=size,
            pool_timeout_s=POOL_TIMEOUT_S,
            name=f"buildarena-api {name}",
        )
        store = open_store(database, lease_s=settings.lease_s, max_faults=settings.max_faults)
        self.context = replace(context, store=store, tasks=TaskCatalog(store.tasks))
        self._threads = ThreadPoolExecutor(size, thread_name_prefix=name)

    async def run(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """What a function returns that one of the threads calls."""
        call = partial(contextvars.copy_context().run, partial(work, *args, **kwargs))
        return await asyncio.get_running_loop().run_in_executor(self._threads, call)

    def close(self) -> None:
        """Waits for what is being done and closes the connections."""
        self._threads.shutdown(cancel_futures=True)
        self.context.store.database.close()
