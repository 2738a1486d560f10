"""An answer of a provider in our own form, and tool calls between our form and theirs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from buildarena_worker.providers.bounds import count_of
from buildarena_worker.session.messages import Reply, ToolCall


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenCounts:
    """What an answer used, as its provider counts.

    Attributes:
        input: Tokens sent, cached ones included.
        output: Tokens received, reasoning included.
        cached: The part of the input read from the provider's cache.
        reasoning: The part of the output that is not shown.
    """

    input: int = 0
    output: int = 0
    cached: int = 0
    reasoning: int = 0

    @staticmethod
    def bounded(sent: Any, received: Any, cached: Any, reasoning: Any) -> TokenCounts:
        """Counts as a provider gave them: what is none is 0, a part is at most its whole.

        Reasoning is the exception: some providers do not count it as output.
        """
        whole = count_of(sent)
        return TokenCounts(
            input=whole,
            output=count_of(received),
            cached=count_of(cached, whole),
            reasoning=count_of(reasoning),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProviderResponse:
    """An answer of a provider.

    Attributes:
        reply: What the model said.
        tokens: What it used.
        response_id: The provider's own id of the answer, if it gave one.
    """

    reply: Reply
    tokens: TokenCounts
    response_id: str | None


def arguments_text(call: ToolCall) -> str:
    """A call's arguments as JSON: an object, even when the model gave something else.

    Providers accept nothing else in a conversation.
    """
    arguments = call.arguments if isinstance(call.arguments, dict) else {"text": call.arguments}
    return json.dumps(arguments, ensure_ascii=False, separators=(",", ":"))
