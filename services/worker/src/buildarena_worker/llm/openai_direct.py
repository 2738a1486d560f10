"""OpenAI's SDK without its walk over the request's types.

The SDK checks every key of every message and tool schema against its type hints before sending,
which costs 4 to 9 ms of processor time per request of ours; pydantic-ai has already built the
body in wire form, so the walk changes nothing. ``post`` is the SDK's public way to send a body
as it is; errors, timeouts and the answer's type stay the SDK's.
"""

from __future__ import annotations

from typing import Any

from openai import AsyncOpenAI, NotGiven, Omit, not_given
from openai._base_client import make_request_options
from openai.resources.chat.completions import AsyncCompletions
from openai.types.chat import ChatCompletion


class DirectCompletions(AsyncCompletions):
    """Sends chat completions as they are."""

    # The SDK's method has some forty keywords in six overloads; ours passes on what it gets.
    async def create(self, **given: Any) -> ChatCompletion:  # type: ignore[override]
        """Sends the keywords as the body, without those that were left out."""
        headers, timeout = given.pop("extra_headers", None), given.pop("timeout", None)
        more = given.pop("extra_body", None) or {}
        body = {k: v for k, v in {**given, **more}.items() if not isinstance(v, (Omit, NotGiven))}
        options = make_request_options(
            extra_headers=headers, timeout=not_given if timeout is None else timeout
        )
        return await self._client.post(
            "/chat/completions", cast_to=ChatCompletion, body=body, options=options
        )


def direct_client(*, base_url: str | None, api_key: str) -> AsyncOpenAI:
    """An SDK client whose chat completions are sent as they are, without retries of its own."""
    client = AsyncOpenAI(base_url=base_url, api_key=api_key, max_retries=0)
    # `completions` is a cached property of the SDK: what stands in its place is used.
    vars(client.chat)["completions"] = DirectCompletions(client)
    return client
