"""Requests and answers of OpenAI's chat completions over aiohttp.

A construct process sends hundreds of requests a second, for which a general library takes 2 to
5 ms of processor time each, most of it for walking the whole conversation several times.
"""

import json
import os
from functools import lru_cache
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import aiohttp
from pydantic_ai.profiles.openai import OpenAIJsonSchemaTransformer

from buildarena_backend import __version__
from buildarena_backend.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.failures import Failure, ProviderError
from buildarena_worker.providers.openai.answer import AnswerReader
from buildarena_worker.providers.response_limits import MAX_BODY
from buildarena_worker.session.messages import Completion, Message, Request


def request_body(entry: ModelEntry, request: Request) -> bytes:
    """Return the body of a request to a model."""
    # A message must not be empty.
    written = [_message(message) for message in request.messages if message.text or message.calls]
    messages = json.dumps(written, ensure_ascii=False)
    tools = [[tool.name, tool.description, tool.parameters] for tool in request.tools]
    decoding = request.model_config["decoding"]
    if entry.max_tokens is not None:
        decoding = {"max_tokens": entry.max_tokens, **decoding}
    options = json.dumps([tools, decoding, entry.extra_body])
    fields = _other_fields(entry.model, options, sampling=entry.sampling)
    return f'{{"messages":{messages},"seed":{request.seed},{fields}'.encode()


@lru_cache(maxsize=256)
def _other_fields(model: str, options: str, *, sampling: bool) -> str:
    """Return the body's fields other than messages and seed, the same for all requests of a role.

    Args:
        model: The provider's name of the model.
        options: Tools, decoding and additional fields, as JSON.
        sampling: Whether the model takes temperature and top_p.
    """
    tools, decoding, extra_body = json.loads(options)
    fields: dict[str, Any] = {"model": model}
    if tools:
        fields["parallel_tool_calls"] = False
        fields["tools"] = [function_tool(*tool) for tool in tools]
        fields["tool_choice"] = "auto"
    fields["stream"] = False
    if "max_tokens" in decoding:
        fields["max_completion_tokens"] = decoding["max_tokens"]
    if sampling:
        fields |= {name: decoding[name] for name in ("temperature", "top_p") if name in decoding}
    return json.dumps(extra_body | fields, ensure_ascii=False)[1:]


def function_tool(name: str, description: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """Return a tool in the form of the protocol's ``tools``.

    A schema that fits OpenAI's strict mode is sent in it, so that the model can't give arguments of
    another form.
    """
    schema = OpenAIJsonSchemaTransformer(parameters)
    function = {"name": name, "description": description, "parameters": schema.walk()}
    strict = {"strict": True} if schema.is_strict_compatible else {}
    return {"type": "function", "function": function | strict}


def _message(message: Message) -> dict[str, Any]:
    if message.role == "tool":
        return {"role": "tool", "tool_call_id": message.call_id or "", "content": message.text}
    if message.role != "assistant":
        return {"role": message.role, "content": message.text}
    written: dict[str, Any] = {"role": "assistant", "content": message.text or None}
    if message.calls:
        written["tool_calls"] = [
            {
                "id": call.id,
                "type": "function",
                "function": {"name": call.name, "arguments": call.arguments_json},
            }
            for call in message.calls
        ]
    return written


OPENAI_URL = "https://api.openai.com/v1"
CONNECT_S = 10.0
"""Longest wait for a connection; the retry policy's timeout limits the request."""


class OpenAIChat:
    """A model behind OpenAI's chat completions.

    Args:
        provider: Base URL of the API, by default OpenAI's, and additional headers.
    """

    def __init__(self, entry: ModelEntry, provider: ProviderEntry, api_key: str) -> None:
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
            **provider.headers,
        }
        self._http: aiohttp.ClientSession | None = None

    async def send(self, request: Request) -> Completion:
        """Return the model's answer to a conversation.

        Raises:
            ProviderError: The provider refuses, can't be reached, or returns an unreadable answer.
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
        """Close the connections."""
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


create_sender = OpenAIChat


async def _body(answer: aiohttp.ClientResponse) -> bytes:
    body = bytearray()
    async for part in answer.content.iter_any():
        body += part
        if len(body) > MAX_BODY:
            answer.close()
            if answer.status >= HTTPStatus.MULTIPLE_CHOICES:
                break
            raise ProviderError(f"the answer is longer than {MAX_BODY:,} bytes", Failure.GARBAGE)
    return bytes(body)


def _proxy_for(url: str) -> str | None:
    """Return the environment's proxy; aiohttp would look it up in another thread each time."""
    parts = urlsplit(url)
    return None if proxy_bypass(parts.hostname or "") else getproxies().get(parts.scheme)
