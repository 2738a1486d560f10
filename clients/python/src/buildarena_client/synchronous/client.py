"""The synchronous client: a method for each thing that the API has, with typed answers."""

from __future__ import annotations

from buildarena_client.synchronous.boards import Boards
from buildarena_client.synchronous.catalogue import Catalogue
from buildarena_client.synchronous.jobs import Jobs
from buildarena_client.synchronous.sessions import Sessions
from buildarena_client.synchronous.sweeps import Sweeps


class Client(Catalogue, Boards, Jobs, Sweeps, Sessions):
    """The API of a service.

    Any thread may use it. A request that changes something is sent once; it is sent again only
    after the service refused it as one too many (429), or where sending it twice changes nothing
    further. Answers are the API's documents, typed as in ``buildarena_client.schemas``; new fields
    may come, so nothing checks them. What no method asks for, ``get``, ``post`` and ``put`` do.
    All methods raise ``ClientError``.
    """
