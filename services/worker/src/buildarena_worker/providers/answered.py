"""An answer of a provider in our own form, and tool calls between our form and theirs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Answered:
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


def arguments_of(raw: Any) -> Any:
    """What a model gave as a call's arguments: an object, or text that is not valid JSON."""
    if not isinstance(raw, str):
        return {} if raw is None else raw
    try:
        return json.loads(raw) if raw.strip() else {}
    except ValueError:
        return raw
