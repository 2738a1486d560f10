"""The synchronous client: a method for each thing that the API has, with typed answers.

Generated from the synchronous module: `make openapi` writes this file.
"""

from __future__ import annotations

from buildarena_client.asynchronous.boards import AsyncBoards
from buildarena_client.asynchronous.catalogue import AsyncCatalogue
from buildarena_client.asynchronous.jobs import AsyncJobs
from buildarena_client.asynchronous.sessions import AsyncSessions
from buildarena_client.asynchronous.sweeps import AsyncSweeps


class AsyncClient(AsyncCatalogue, AsyncBoards, AsyncJobs, AsyncSweeps, AsyncSessions):
    """The API of a service.

    Any thread may use it. A request that changes something is sent once; it is sent again only
    after the service refused it as one too many (429), or where sending it twice changes nothing
    further. Answers are the API's documents, typed as in ``buildarena_client.schemas``; new fields
    may come, so nothing checks them. What no method asks for, ``get``, ``post`` and ``put`` do.
    All methods raise ``ClientError``.
    """
