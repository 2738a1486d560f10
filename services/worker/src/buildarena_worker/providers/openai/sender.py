"""Requests and answers of OpenAI's chat completions over aiohttp.

A construct process sends hundreds of requests a second, for which a general library takes 2 to
5 ms of processor time each, most of it for walking the whole conversation several times.
"""

from __future__ import annotations

import os
from http import HTTPStatus
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import aiohttp

from buildarena_backend import __version__
from buildarena_backend.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.bounds import MAX_BODY
from buildarena_worker.providers.failures import Failure, ProviderError
from buildarena_worker.providers.openai.answer import AnswerReader
from buildarena_worker.providers.openai.request import request_body
from buildarena_worker.session.messages import Completion, Request

OPENAI_URL = "https://api.openai.com/v1"
CONNECT_S = 10.0
"""Longest wait for a connection; the retry policy's own timeout rules the whole."""
ACCOUNT_HEADERS = {
    "OPENAI_ORG_ID": "OpenAI-Organization",
    "OPENAI_PROJECT_ID": "OpenAI-Project",
}
"""By environment variable: what OpenAI's own clients send along with the key."""


class OpenAIChat:
    """One model behind OpenAI's chat completions.

    Args:
        entry: The model.
        provider: Where the API is, by default OpenAI's own, and further headers.
        api_key: The key.
    """

    def __init__(self, entry: ModelEntry, provider: ProviderEntry, *, api_key: str) -> None:
        base_url = provider.base_url or os.environ.get("OPENAI_BASE_URL") or OPENAI_URL
        self._endpoint = f"{base_url.rstrip('/')}/chat/completions"
        self._proxy = _proxy_for(base_url)
        self._entry = entry
        self._reader = AnswerReader(base_url)
        self._headers = {
            "Accept": "application/json",
            "Content-Type": "application/json",
            "User-Agent": f"buildarena/{__version__}",
            "Authorization": f"Bearer {api_key}",
        } | {
            header: os.environ[name]
            for name, header in ACCOUNT_HEADERS.items()
            if name in os.environ
        }
        self._headers |= provider.headers
        self._http: aiohttp.ClientSession | None = None

    async def send(self, request: Request) -> Completion:
        """The model's answer to a conversation.

        Raises:
            ProviderError: The provider says no, can't be reached, or answers nonsense.
        """
        try:
            async with self._session().post(
                self._endpoint,
                data=request_body(self._entry, request),
                headers=self._headers,
                allow_redirects=False,
            ) as answer:
                text = await _body(answer)
        except (aiohttp.ClientError, OSError) as error:
            detail = str(error) or type(error).__name__
            raise ProviderError(f"no connection: {detail}", Failure.OUTAGE) from error
        headers = {name.lower(): value for name, value in answer.headers.items()}
        return self._reader.read(answer.status, headers, text)

    async def close(self) -> None:
        """Closes the connections."""
        if self._http is not None:
            await self._http.close()

    def _session(self) -> aiohttp.ClientSession:
        if self._http is None:  # must be made on the loop that uses it
            self._http = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),  # the shared throttle limits
                timeout=aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_S),
                cookie_jar=aiohttp.DummyCookieJar(),
                proxy=self._proxy,
            )
        return self._http


def create_sender(entry: ModelEntry, provider: ProviderEntry, key: str) -> OpenAIChat:
    """The sender of a model."""
    return OpenAIChat(entry, provider, api_key=key)


async def _body(answer: aiohttp.ClientResponse) -> bytes:
    parts, size = [], 0
    async for part in answer.content.iter_any():
        parts.append(part)
        size += len(part)
        if size > MAX_BODY:
            answer.close()
            if answer.status >= HTTPStatus.MULTIPLE_CHOICES:
                break
            raise ProviderError(f"the answer is longer than {MAX_BODY:,} bytes", Failure.GARBAGE)
    return b"".join(parts)


def _proxy_for(url: str) -> str | None:
    """The environment's proxy; aiohttp itself would ask for it in another thread each time."""
    parts = urlsplit(url)
    return None if proxy_bypass(parts.hostname or "") else getproxies().get(parts.scheme)
