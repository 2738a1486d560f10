"""Bounds on answers, so that they can be stored, sent back and added up."""

import json
from dataclasses import replace
from typing import Any

from buildarena_backend.journal.journal import Usage
from buildarena_geometry.json_texts import read_json, write_json
from buildarena_worker.session.messages import Completion, ToolCall

MAX_BODY = 8 * 1024 * 1024
"""Bytes of an answer; the rest is not read."""
MAX_TEXT = 256 * 1024
"""Characters of a reply's text: more than any model gives in one reply."""
MAX_ARGUMENTS = 64 * 1024
"""Characters of a tool call's arguments as JSON."""
MAX_DEPTH = 32
"""Objects and lists within each other in a tool call's arguments."""
MAX_CALLS = 16
"""Tool calls of one reply: of more than one, all are refused."""
MAX_NAME = 256
"""Characters of a tool's name, and of ids."""
MAX_TOKENS = 10_000_000
"""Tokens of one answer: more than any model's context."""


def count_of(value: Any, maximum: int = MAX_TOKENS) -> int:
    """Return a provider's count within 0 and a maximum; 0 if it is not an integer."""
    if isinstance(value, bool) or not isinstance(value, int):
        return 0
    return min(max(value, 0), maximum)


def usage_of(sent: Any, received: Any, cached: Any, reasoning: Any) -> Usage:
    """Return one request's use as its provider counts it; malformed counts are 0.

    Cached tokens are limited to the sent ones. Reasoning is not limited by the output: some
    providers do not count it as output.
    """
    input_tokens = count_of(sent)
    return Usage(
        requests=1,
        input_tokens=input_tokens,
        output_tokens=count_of(received),
        cached_tokens=count_of(cached, input_tokens),
        reasoning_tokens=count_of(reasoning),
    )


def bounded(completion: Completion) -> Completion:
    """Return a completion without what exceeds the bounds.

    Raises:
        TypeError: A text or a name is not a string.
    """
    calls = tuple(
        ToolCall(
            id=_text(str(call.id) if isinstance(call.id, int) else call.id, MAX_NAME),
            name=_text(call.name, MAX_NAME),
            arguments=bounded_arguments(call.arguments),
        )
        for call in completion.calls[:MAX_CALLS]
    )
    text = _text(completion.text, MAX_TEXT)
    finish = completion.finish if text == completion.text else "length"
    return replace(
        completion,
        text=text,
        calls=calls,
        finish=finish,
        provider_request_id=_name(completion.provider_request_id),
        system_fingerprint=_name(completion.system_fingerprint),
    )


def _name(value: Any) -> str | None:
    return None if value is None else str(value)[:MAX_NAME]


def arguments_of(raw: Any) -> Any:
    """Return a call's arguments: an object, or text that is not valid JSON."""
    if not isinstance(raw, str):
        return {} if raw is None else raw
    if len(raw) > MAX_ARGUMENTS:
        return raw[:MAX_ARGUMENTS]
    try:
        return read_json(raw) if raw.strip() else {}
    except ValueError:
        return raw


def bounded_arguments(arguments: Any) -> Any:
    """Return arguments that can be stored as JSON; the beginning of their text if they can't."""
    if isinstance(arguments, str):
        return arguments[:MAX_ARGUMENTS]
    try:
        plain = json.loads(write_json(arguments, MAX_DEPTH))
    except (TypeError, ValueError):
        return f"(more than {MAX_DEPTH} levels deep, or not JSON)"
    spelled = json.dumps(plain, ensure_ascii=False)
    return plain if len(spelled) <= MAX_ARGUMENTS else spelled[:MAX_ARGUMENTS]


def _text(value: Any, maximum: int) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{type(value).__name__} in the place of text")
    return value[:maximum]
