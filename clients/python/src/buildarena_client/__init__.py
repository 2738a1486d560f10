"""The Python client of BuildArena's HTTP API, synchronous and asynchronous.

Importing it loads errors alone: each other name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from buildarena_client.errors import BadArgumentError as BadArgumentError
from buildarena_client.errors import ClientError as ClientError
from buildarena_client.errors import ConflictError as ConflictError
from buildarena_client.errors import DamagedError as DamagedError
from buildarena_client.errors import ForbiddenError as ForbiddenError
from buildarena_client.errors import InvalidError as InvalidError
from buildarena_client.errors import KeyRefusedError as KeyRefusedError
from buildarena_client.errors import MissingLibraryError as MissingLibraryError
from buildarena_client.errors import NotAnApiError as NotAnApiError
from buildarena_client.errors import NotFoundError as NotFoundError
from buildarena_client.errors import RefusedError as RefusedError
from buildarena_client.errors import ServiceFaultError as ServiceFaultError
from buildarena_client.errors import TimedOutError as TimedOutError
from buildarena_client.errors import TooLargeError as TooLargeError
from buildarena_client.errors import TooManyRequestsError as TooManyRequestsError
from buildarena_client.errors import UnavailableError as UnavailableError
from buildarena_client.errors import UnreachableError as UnreachableError

if TYPE_CHECKING:
    from buildarena_client.client import AsyncClient as AsyncClient
    from buildarena_client.client import Client as Client
    from buildarena_client.event_streams import Event as Event
    from buildarena_client.frames import jobs_frame as jobs_frame
    from buildarena_client.frames import leaderboard_frame as leaderboard_frame
    from buildarena_client.frames import results_frame as results_frame
    from buildarena_client.frames import sweeps_frame as sweeps_frame
    from buildarena_client.retries import RetryPolicy as RetryPolicy

_HOMES = {
    "AsyncClient": "client",
    "Client": "client",
    "Event": "event_streams",
    "jobs_frame": "frames",
    "leaderboard_frame": "frames",
    "results_frame": "frames",
    "sweeps_frame": "frames",
    "RetryPolicy": "retries",
}
__all__ = sorted({*_HOMES, *filter(lambda name: name.endswith("Error"), globals())})  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
