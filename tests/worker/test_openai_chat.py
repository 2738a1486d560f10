"""What is read and written directly equals what pydantic-ai and OpenAI's SDK make of it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from typing import Any

import httpx2
import pytest
from openai import AsyncOpenAI
from provider_standin import ProviderStandIn
from pydantic_ai.direct import model_request
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider
from pydantic_ai.settings import ModelSettings

from buildarena_worker.providers.openai_chat import OpenAIChat
from buildarena_worker.providers.openai_wire import read_answer
from buildarena_worker.providers.wire import Answered, from_wire, request_parameters, to_wire
from buildarena_worker.session.messages import Message, Tool, ToolCall
from buildarena_worker.workflow.machine_tools import BUILD, tools_named

URL = "http://provider.test/v1/"
SYSTEM = Message(role="system", text="Build.")
CALL = ToolCall(id="c1", name="start", arguments={"block": "Wüfel", "n": 1.5})
TALK = [
    SYSTEM,
    Message(role="user", text="Go on \N{EN DASH} please"),
    Message(role="assistant", text="I start.", calls=(CALL,)),
    Message(role="tool", text="[OK]", call_id="c1", tool="start"),
    Message(role="user", text="more"),
    Message(role="user", text="and more"),
    Message(role="assistant", text="", calls=(ToolCall(id="c2", name="x", arguments="no"),)),
    Message(role="tool", text="[ERR]", call_id="c2", tool="x"),
    Message(role="assistant", text="(no answer)"),
    Message(role="assistant", text=""),
    Message(role="user", text="end"),
]


async def through_library(
    answer: dict[str, Any] | None,
    *,
    model: str = "standin",
    messages: Sequence[Message] = (SYSTEM, Message(role="user", text="u")),
    tools: Sequence[Tool] = (),
    settings: ModelSettings | None = None,
    url: str = URL,
) -> tuple[dict[str, Any], Answered | None]:
    """The body that pydantic-ai sends, and what it makes of an answer."""
    sent: list[dict[str, Any]] = []

    def provider(request: httpx2.Request) -> httpx2.Response:
        sent.append(json.loads(request.content))
        return httpx2.Response(200, json=answer if answer is not None else plain())

    http = httpx2.AsyncClient(transport=httpx2.MockTransport(provider))
    async with AsyncOpenAI(base_url=url, api_key="k", max_retries=0, http_client=http) as client:
        response = await model_request(
            OpenAIChatModel(model, provider=OpenAIProvider(openai_client=client)),
            to_wire(messages),
            model_settings=settings or ModelSettings(seed=3),
            model_request_parameters=request_parameters(tools),
        )
    return sent[0], from_wire(response)


def plain(**changes: Any) -> dict[str, Any]:
    message = {"role": "assistant", "content": "Yes.", **changes.pop("message", {})}
    choice = {"index": 0, "finish_reason": "stop", "message": message, **changes.pop("choice", {})}
    usage = {"prompt_tokens": 90, "completion_tokens": 10, "total_tokens": 100}
    return {
        "id": "r-1",
        "object": "chat.completion",
        "created": 1700000000,
        "model": "standin-2",
        "choices": [choice],
        "usage": usage,
        **changes,
    }


def counted(answered: Answered | None) -> tuple[Any, ...]:
    """What of an answer is kept."""
    assert answered is not None
    used = answered.usage
    reasoning = used.details.get("reasoning_tokens", 0)
    tokens = (used.input_tokens, used.output_tokens, used.cache_read_tokens, reasoning)
    return answered.reply, answered.response_id, tokens


MODELS = ["gpt-4o", "gpt-5", "o3", "o1-mini", "deepseek-chat", "anything"]
SETTINGS = [
    ModelSettings(seed=3),
    ModelSettings(seed=0, temperature=0.5, top_p=0.9, max_tokens=100, parallel_tool_calls=False),
]


@pytest.mark.filterwarnings("ignore:Sampling parameters:UserWarning")
@pytest.mark.parametrize("tools", [[], tools_named(BUILD)], ids=["bare", "tools"])
@pytest.mark.parametrize("settings", SETTINGS, ids=["seed", "all"])
@pytest.mark.parametrize("model", MODELS)
def test_requests_carry_what_the_library_would_send(model, settings, tools) -> None:
    async def main(url: str) -> dict[str, Any]:
        wanted, _ = await through_library(
            None, model=model, messages=TALK, tools=tools, settings=settings
        )
        chat = OpenAIChat(model=model, base_url=url, api_key="k")
        for seed in (settings["seed"], 77):  # the second has its frame already
            await chat.send(TALK, tools, ModelSettings(**{**settings, "seed": seed}))
        await chat.close()
        return wanted

    with ProviderStandIn("idle") as standin:
        wanted = asyncio.run(main(f"{standin.url}/v1"))
    assert standin.counts.bodies == [wanted, {**wanted, "seed": 77}]


def calls(*arguments: str) -> list[dict[str, Any]]:
    return [
        {"id": f"c{n}", "type": "function", "function": {"name": "start", "arguments": text}}
        for n, text in enumerate(arguments)
    ]


READ = {
    "text": plain(),
    "empty": plain(message={"content": None}),
    "a call": plain(
        message={"content": None, "tool_calls": calls('{"a": 1}')},
        choice={"finish_reason": "tool_calls"},
    ),
    "calls, one broken": plain(message={"tool_calls": calls("{}", "", "{oops", "[1]")}),
    "cut": plain(choice={"finish_reason": "length"}),
    "filtered": plain(choice={"finish_reason": "content_filter"}),
    "reasoned": plain(
        message={"reasoning_content": "hm"},
        usage={
            "prompt_tokens": 90,
            "completion_tokens": 10,
            "total_tokens": 100,
            "prompt_tokens_details": {"cached_tokens": 64, "audio_tokens": None},
            "completion_tokens_details": {"reasoning_tokens": 7},
        },
    ),
    "deepseek's cache": plain(
        usage={
            "prompt_tokens": 90,
            "completion_tokens": 10,
            "total_tokens": 100,
            "prompt_cache_hit_tokens": 60,
            "prompt_cache_miss_tokens": 30,
        }
    ),
}
URLS = [URL, "https://api.openai.com/v1/", "https://api.deepseek.com/", "https://api.x.ai/v1/"]


@pytest.mark.parametrize("url", URLS)
@pytest.mark.parametrize("name", READ)
def test_plain_answers_mean_what_the_library_says(name, url) -> None:
    _, wanted = asyncio.run(through_library(READ[name], url=url))
    read = read_answer(json.dumps(READ[name]).encode(), provider_url=url)
    assert counted(read) == counted(wanted)


LEFT = {
    "thoughts in the text": plain(message={"content": "<think>hm</think>Yes."}),
    "a refusal": plain(message={"content": None, "refusal": "No."}),
    "text in parts": plain(message={"content": [{"type": "text", "text": "Yes."}]}),
    "no finish": plain(choice={"finish_reason": None}),
    "an unknown finish": plain(choice={"finish_reason": "tired"}),
    "no choices": plain(choices=[]),
    "no usage": plain(usage=None),
    "a call without id": plain(message={"tool_calls": [{**calls("{}")[0], "id": ""}]}),
    "a call of another type": plain(message={"tool_calls": [{**calls("{}")[0], "type": "x"}]}),
    "no object": ["x"],
}


@pytest.mark.parametrize("name", LEFT)
def test_all_other_answers_are_left_to_the_library(name) -> None:
    assert read_answer(json.dumps(LEFT[name]).encode(), provider_url=URL) is None


@pytest.mark.parametrize("name", ["thoughts in the text", "a refusal", "no finish"])
def test_what_is_left_to_the_library_comes_back_from_it(name) -> None:
    _, wanted = asyncio.run(through_library(LEFT[name]))

    async def main(url: str) -> Answered:
        chat = OpenAIChat(model="standin", base_url=url, api_key="k")
        answered = await chat.send([SYSTEM], [], ModelSettings(seed=1))
        await chat.close()
        return answered

    with ProviderStandIn(raw=LEFT[name]) as standin:
        assert counted(asyncio.run(main(f"{standin.url}/v1"))) == counted(wanted)
    assert standin.counts.requests == 1
