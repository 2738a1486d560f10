"""OpenAI's chat completions over aiohttp: the wire that most providers speak.

A construct process sends hundreds of requests a second, for which pydantic-ai and the SDK take
2 to 5 ms of processor time each. So what is plain is done here: messages are written, and answers
that hold nothing but text, function calls and usage are read. pydantic-ai still says all that
differs between models and providers: once for each set of tools and settings what is sent besides
the messages, and what an answer means that is not plain, errors included.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any
from urllib.request import getproxies, proxy_bypass

import aiohttp
from httpx2 import Request, Response
from openai import APIConnectionError, AsyncOpenAI, NotGiven, Omit
from openai.resources.chat.completions import AsyncCompletions
from openai.types.chat import ChatCompletion
from pydantic import ValidationError
from pydantic_ai.direct import model_request
from pydantic_ai.messages import ModelMessage, ModelRequest, SystemPromptPart, UserPromptPart
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider
from pydantic_ai.settings import ModelSettings

from buildarena_worker.providers.openai_wire import read_answer, write_messages
from buildarena_worker.providers.wire import Answered, from_wire, request_parameters
from buildarena_worker.session.messages import Message, Tool

CONNECT_S = 10.0
"""Longest wait for a connection; the retry policy's own timeout rules the whole."""
MAX_FRAMES = 256
"""Frames kept; a role needs one, and a process has few roles."""
SAMPLE: Sequence[ModelMessage] = (
    ModelRequest(parts=[SystemPromptPart(content="s"), UserPromptPart(content="u")]),
)


@dataclass(frozen=True, slots=True)
class _Frame:
    """What surrounds a request's messages and seed: the rest of the body as JSON, the headers."""

    rest: str
    headers: dict[str, str]
    system_role: str
    takes_seed: bool


class _FrameMade(Exception):  # noqa: N818 - a way out of the library, no error
    def __init__(self, body: dict[str, Any], headers: dict[str, str]) -> None:
        super().__init__()
        self.body = body
        self.headers = headers


class OpenAIChat:
    """One model behind OpenAI's chat completions.

    Args:
        model: The provider's name for the model.
        base_url: Where the API is; None for OpenAI's own.
        api_key: The key.
    """

    def __init__(self, *, model: str, base_url: str | None, api_key: str) -> None:
        self._model = model
        self._sdk = AsyncOpenAI(base_url=base_url, api_key=api_key, max_retries=0)
        self._endpoint = f"{self._sdk.base_url}chat/completions"
        self._proxy = _proxy_for(self._sdk.base_url.scheme, self._sdk.base_url.host)
        self._frames: dict[str, _Frame] = {}
        self._http: aiohttp.ClientSession | None = None

    async def send(
        self, messages: Sequence[Message], tools: Sequence[Tool], settings: ModelSettings
    ) -> Answered:
        """The model's answer to a conversation.

        Raises:
            ModelAPIError: The provider says no, can't be reached, or answers nonsense.
        """
        frame = await self._frame(tools, settings)
        spoken = json.dumps(write_messages(messages, frame.system_role), ensure_ascii=False)
        seed = f'"seed":{settings["seed"]},' if frame.takes_seed else ""
        data = f'{{"messages":{spoken},{seed}{frame.rest[1:]}'.encode()
        try:
            async with self._session().post(
                self._endpoint, data=data, headers=frame.headers
            ) as answer:
                text = await answer.read()
        except (aiohttp.ClientError, OSError) as error:
            broken = APIConnectionError(request=Request("POST", self._endpoint))
            broken.__cause__ = error
            return await self._ask_library(lambda **_: _raise(broken), tools, settings)
        if answer.status == HTTPStatus.OK:
            answered = read_answer(text, provider_url=str(self._sdk.base_url))
            if answered is not None:
                return answered
        # aiohttp has unpacked the text already.
        kept = [(k, v) for k, v in answer.headers.items() if k.lower() != "content-encoding"]
        sent = Request("POST", self._endpoint)
        response = Response(answer.status, headers=kept, content=text, request=sent)
        return await self._ask_library(lambda **_: self._as_sdk_gives_it(response), tools, settings)

    async def close(self) -> None:
        """Closes the connections."""
        if self._http is not None:
            await self._http.close()
        await self._sdk.close()

    def _session(self) -> aiohttp.ClientSession:
        if self._http is None:  # must be made on the loop that uses it
            self._http = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),  # the shared throttle limits
                timeout=aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_S),
                cookie_jar=aiohttp.DummyCookieJar(),
                proxy=self._proxy,
            )
        return self._http

    async def _frame(self, tools: Sequence[Tool], settings: ModelSettings) -> _Frame:
        """What pydantic-ai would send around the messages, asked for once and kept."""
        shared = {name: value for name, value in settings.items() if name != "seed"}
        key = json.dumps([[[t.name, t.description, t.parameters] for t in tools], shared])
        frame = self._frames.get(key)
        if frame is None:
            if len(self._frames) >= MAX_FRAMES:
                self._frames.clear()
            frame = self._frames[key] = await self._make_frame(tools, settings)
        return frame

    async def _make_frame(self, tools: Sequence[Tool], settings: ModelSettings) -> _Frame:
        def keep(**given: Any) -> ChatCompletion:
            headers, more = given.pop("extra_headers", None), given.pop("extra_body", None)
            given.pop("timeout", None)
            raise _FrameMade(_given({**given, **(more or {})}), _given(headers or {}))

        try:
            await self._ask_library(keep, tools, settings)
        except _FrameMade as made:
            (system, _user) = made.body.pop("messages")
            takes_seed = made.body.pop("seed", None) is not None
            own = _given({**self._sdk.default_headers, **self._sdk.auth_headers})
            return _Frame(
                rest=json.dumps(made.body, ensure_ascii=False),
                headers={**own, **made.headers},
                system_role=system["role"],
                takes_seed=takes_seed,
            )
        raise AssertionError("the library sends what it is given")

    async def _ask_library(
        self, create: Callable[..., Any], tools: Sequence[Tool], settings: ModelSettings
    ) -> Answered:
        """What pydantic-ai makes of what ``create`` gives or raises in the SDK's place."""
        client = self._sdk.copy()
        # `completions` is a cached property of the SDK: what stands in its place is used.
        vars(client.chat)["completions"] = _Completions(client, create)
        model = OpenAIChatModel(self._model, provider=OpenAIProvider(openai_client=client))
        response = await model_request(
            model,
            SAMPLE,
            model_settings=settings,
            model_request_parameters=request_parameters(tools),
        )
        return from_wire(response)

    def _as_sdk_gives_it(self, response: Response) -> Any:
        """The SDK's type, unchecked where the answer does not fit; the SDK's error for a no."""
        if response.status_code >= HTTPStatus.BAD_REQUEST:
            raise self._sdk._make_status_error_from_response(response)  # noqa: SLF001 - no other way
        try:
            return ChatCompletion.model_validate_json(response.content)
        except ValidationError:
            parsed = json.loads(response.content)
            return ChatCompletion.construct(**parsed) if isinstance(parsed, dict) else parsed


class _Completions(AsyncCompletions):
    def __init__(self, client: AsyncOpenAI, create: Callable[..., Any]) -> None:
        super().__init__(client)
        self._create = create

    # The SDK's method has some forty keywords in six overloads; ours passes on what it gets.
    async def create(self, **given: Any) -> Any:
        return self._create(**given)


def _raise(error: Exception) -> None:
    raise error


def _proxy_for(scheme: str, host: str) -> str | None:
    """The environment's proxy; aiohttp itself would ask for it in another thread each time."""
    return None if proxy_bypass(host) else getproxies().get(scheme)


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {name: v for name, v in values.items() if not isinstance(v, (Omit, NotGiven))}
