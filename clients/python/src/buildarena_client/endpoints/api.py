"""All endpoints of the API."""

from __future__ import annotations

from buildarena_client.endpoints.boards import Boards
from buildarena_client.endpoints.catalogue import Catalogue
from buildarena_client.endpoints.jobs import Jobs
from buildarena_client.endpoints.sessions import Sessions
from buildarena_client.endpoints.sweeps import Sweeps


class Api(Catalogue, Boards, Jobs, Sweeps, Sessions):
    """All endpoints of the API, as coroutines over a transport."""
