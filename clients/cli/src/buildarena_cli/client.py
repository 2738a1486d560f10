"""The API client of the command line, which converts errors to those of commands."""

from __future__ import annotations

import contextlib
from collections.abc import Coroutine, Iterator
from typing import Any, TypeVar

from buildarena_cli.errors import CommandError, suggest_field
from buildarena_client import errors, paths
from buildarena_client.client import Client as ApiClient
from buildarena_client.config import KEY_VARIABLE
from buildarena_client.paths import HEALTH
from buildarena_client.retries import RetryPolicy

T = TypeVar("T")
RESTART_S = RetryPolicy().restart_s
"""How long a watching command waits for a service that is being restarted."""


def at(*parts: str) -> str:
    """Return the path of a resource; its parts can't reach another route.

    Raises:
        CommandError: A part is not a name.
    """
    with _in_words():
        return paths.at(*parts)


class Client(ApiClient):
    """API client that raises CommandErrors.

    Args:
        url: Base URL of the API, for example ``http://127.0.0.1:8321``.
        key: The API key; by default the one in BUILDARENA_KEY, if any.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        with _in_words():
            super().__init__(url, key)

    def _run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        with _in_words():
            return super()._run(coroutine)


class RefusedError(CommandError):
    """The service refused a request.

    Args:
        error: The client's error.

    Attributes:
        errors: Field errors: ``field``, ``message``, ``line`` and ``choices`` of each.
    """

    def __init__(self, error: errors.RefusedError) -> None:
        super().__init__("\n".join(map(_line, error.errors)) or error.detail)
        self.status = error.status
        self.errors: list[dict[str, Any]] = error.errors


class UnreachableError(CommandError, errors.UnreachableError):
    """The service does not answer at present; it may later, so commands that watch continue."""


@contextlib.contextmanager
def _in_words() -> Iterator[None]:
    try:
        yield
    except CommandError:
        raise
    except errors.ClientError as error:
        raise _worded(error) from error


def _worded(error: errors.ClientError) -> CommandError:
    if isinstance(error, errors.KeyRefusedError):
        return CommandError(f"{error}: set {KEY_VARIABLE} or {KEY_VARIABLE}_FILE to a valid key")
    if isinstance(error, errors.RefusedError):
        return RefusedError(error)
    if isinstance(error, errors.UnavailableError):
        return UnreachableError(str(error))
    if isinstance(error, errors.UnreachableError):
        return UnreachableError(
            f"{error}: start it with `buildarena up`, or name another with --url or BUILDARENA_URL"
        )
    return CommandError(str(error))


def _line(error: dict[str, Any]) -> str:
    hint = suggest_field(error["field"], error["message"], error["choices"])
    return errors.described(error) + (hint if error["choices"] else "")


__all__ = ["HEALTH", "RESTART_S", "Client", "RefusedError", "UnreachableError", "at"]
