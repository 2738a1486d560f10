"""OpenAI's chat completions over aiohttp, behind the SDK's own face.

The SDK checks every key of every message against its type hints, and its HTTP client builds each
request and looks through its connections anew: together 3 to 5 ms of processor time a request
of ours, where aiohttp takes a quarter of one. pydantic-ai has already built the body in wire form,
so it is sent as it is; the answer's type, the errors and the headers stay the SDK's.
"""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import Any
from urllib.request import getproxies, proxy_bypass

import aiohttp
from httpx2 import Request, Response
from openai import APIConnectionError, AsyncOpenAI, NotGiven, Omit
from openai.resources.chat.completions import AsyncCompletions
from openai.types.chat import ChatCompletion
from pydantic import ValidationError
from pydantic_ai.models import ModelRequestParameters
from pydantic_ai.models.openai import OpenAIChatModel

CONNECT_S = 10.0
"""Longest wait for a connection; the retry policy's own timeout rules the whole."""
MOST_TOOL_SETS = 256
"""Sets of tools kept in a provider's form; a role has one, and a process few roles."""


class RememberingChatModel(OpenAIChatModel):
    """Brings each set of tools into the provider's form once, not for every request.

    Our requests differ in nothing else that is customised.
    """

    # pydantic-ai makes its models dataclasses that set fields of their own.
    _known_tools: dict[str, ModelRequestParameters] | None = None

    def customize_request_parameters(
        self, model_request_parameters: ModelRequestParameters
    ) -> ModelRequestParameters:
        """The parameters with the tools in the provider's form."""
        if self._known_tools is None or len(self._known_tools) >= MOST_TOOL_SETS:
            self._known_tools = {}
        key = json.dumps(
            [
                (tool.name, tool.description, tool.parameters_json_schema)
                for tool in model_request_parameters.function_tools
            ]
        )
        known = self._known_tools.get(key)
        if known is None:
            known = super().customize_request_parameters(model_request_parameters)
            self._known_tools[key] = known
        return known


class DirectClient(AsyncOpenAI):
    """An SDK client that sends its chat completions as they are, without retries of its own."""

    def __init__(self, *, base_url: str | None, api_key: str) -> None:
        super().__init__(base_url=base_url, api_key=api_key, max_retries=0)
        self._endpoint = f"{self.base_url}chat/completions"
        self._own_headers = _given({**self.default_headers, **self.auth_headers})
        self._proxy = _proxy_for(self.base_url.scheme, self.base_url.host)
        self._http: aiohttp.ClientSession | None = None
        # `completions` is a cached property of the SDK: what stands in its place is used.
        vars(self.chat)["completions"] = _DirectCompletions(self)

    async def complete(self, body: dict[str, Any], headers: dict[str, Any]) -> ChatCompletion:
        """Sends a body and gives the answer as the SDK's type, unchecked where it does not fit.

        Raises:
            APIStatusError: The provider says no.
            APIConnectionError: It can't be reached, or the connection broke.
        """
        data = json.dumps(body, ensure_ascii=False, separators=(",", ":")).encode()
        if self._http is None:  # must be made on the loop that uses it
            self._http = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),  # the shared throttle limits
                timeout=aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_S),
                cookie_jar=aiohttp.DummyCookieJar(),
                proxy=self._proxy,
            )
        try:
            async with self._http.post(
                self._endpoint, data=data, headers={**self._own_headers, **headers}
            ) as answer:
                text = await answer.read()
        except (aiohttp.ClientError, OSError) as error:
            raise APIConnectionError(request=Request("POST", self._endpoint)) from error
        if answer.status >= HTTPStatus.BAD_REQUEST:
            # aiohttp has unpacked the text already.
            kept = [(k, v) for k, v in answer.headers.items() if k.lower() != "content-encoding"]
            sent = Request("POST", self._endpoint)
            raise self._make_status_error_from_response(
                Response(answer.status, headers=kept, content=text, request=sent)
            )
        try:
            return ChatCompletion.model_validate_json(text)
        except ValidationError:
            # The SDK lets everything pass; pydantic-ai mends it or says what is wrong.
            parsed = json.loads(text)
            return ChatCompletion.construct(**parsed) if isinstance(parsed, dict) else parsed

    async def close(self) -> None:
        """Closes the connections."""
        if self._http is not None:
            await self._http.close()
        await super().close()


class _DirectCompletions(AsyncCompletions):
    def __init__(self, client: DirectClient) -> None:
        super().__init__(client)
        self._direct = client

    # The SDK's method has some forty keywords in six overloads; ours passes on what it gets.
    async def create(self, **given: Any) -> ChatCompletion:  # type: ignore[override]
        """Sends the keywords as the body, without those that were left out."""
        headers, more = given.pop("extra_headers", None) or {}, given.pop("extra_body", None) or {}
        given.pop("timeout", None)
        return await self._direct.complete(_given({**given, **more}), _given(headers))


def _proxy_for(scheme: str, host: str) -> str | None:
    """The environment's proxy; aiohttp itself would ask for it in another thread each time."""
    return None if proxy_bypass(host) else getproxies().get(scheme)


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {name: v for name, v in values.items() if not isinstance(v, (Omit, NotGiven))}
