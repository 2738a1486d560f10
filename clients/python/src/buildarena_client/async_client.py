"""The asynchronous client."""

from __future__ import annotations

from functools import partial
from types import TracebackType
from typing import Final, Self

from buildarena_client.endpoints.api import Api
from buildarena_client.endpoints.sending import TIMEOUT_S
from buildarena_client.retries import RetryPolicy

AT_ONCE: Final = 16
"""Of one caller, the service has 96 requests open at most."""


class AsyncClient(Api):
    """The API of a service: the methods of ``Client``, awaited.

    Args:
        url: Where it is, for example ``http://127.0.0.1:8321``; by default BUILDARENA_URL.
        key: The API key; by default the one in BUILDARENA_KEY, or in the file that
            BUILDARENA_KEY_FILE names, if any.
        timeout_s: How long nothing may come before a request is given up.
        retries: How long requests are sent again.
        at_once: Requests that are open at most; further ones wait. Downloads and
            streams are not counted.

    Attributes:
        url: Where the service is.

    Raises:
        BadArgumentError: That is not the URL of an API, or not a key.
    """

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        timeout_s: float | None = TIMEOUT_S,
        retries: RetryPolicy | None = None,
        at_once: int = AT_ONCE,
    ) -> None:
        from buildarena_client.transports.asynchronous import AsyncTransport

        super().__init__(
            url,
            key,
            timeout_s=timeout_s,
            retries=retries or RetryPolicy(),
            transport=partial(AsyncTransport, at_once=at_once),
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()
