"""The Python client of BuildArena's HTTP API, synchronous and asynchronous.

Importing it loads nothing: each name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from buildarena_client.async_client import AsyncClient as AsyncClient
    from buildarena_client.client import Client as Client
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
    from buildarena_client.event_streams import Event as Event
    from buildarena_client.frames import jobs_frame as jobs_frame
    from buildarena_client.frames import leaderboard_frame as leaderboard_frame
    from buildarena_client.frames import results_frame as results_frame
    from buildarena_client.frames import sweeps_frame as sweeps_frame
    from buildarena_client.retries import RetryPolicy as RetryPolicy

_HOMES = {
    "async_client": ("AsyncClient",),
    "client": ("Client",),
    "errors": (
        "BadArgumentError",
        "ClientError",
        "ConflictError",
        "DamagedError",
        "ForbiddenError",
        "InvalidError",
        "KeyRefusedError",
        "MissingLibraryError",
        "NotAnApiError",
        "NotFoundError",
        "RefusedError",
        "ServiceFaultError",
        "TimedOutError",
        "TooLargeError",
        "TooManyRequestsError",
        "UnavailableError",
        "UnreachableError",
    ),
    "event_streams": ("Event",),
    "frames": ("jobs_frame", "leaderboard_frame", "results_frame", "sweeps_frame"),
    "retries": ("RetryPolicy",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
__all__ = sorted(_HOME_OF)  # noqa: PLE0605 - as the table above says


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME_OF})
