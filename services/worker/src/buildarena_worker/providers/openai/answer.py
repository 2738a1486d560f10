"""Answers in OpenAI's chat completions: replies, their use of tokens, and errors.

Written from OpenAI's API reference, and lenient where other providers of this protocol differ.
``tests/worker/providers/test_openai.py`` has a stored answer of each kind.
"""

import uuid
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from http import HTTPStatus
from typing import Any

from genai_prices.data_snapshot import get_snapshot

from buildarena_backend.journal.journal import Usage
from buildarena_geometry.json_texts import read_json
from buildarena_worker.providers.failures import (
    Failure,
    ProviderError,
    failure_of_status,
    redirect_error,
)
from buildarena_worker.providers.response_limits import MAX_CALLS, arguments_of, bounded, usage_of
from buildarena_worker.session.messages import ONE_REQUEST, Completion, ToolCall

UNREADABLE = (ValueError, KeyError, IndexError, TypeError, AttributeError)
FINISH = {"length": "length", "content_filter": "content_filter"}
"""Reasons to stop other than that the model was done."""
THINKING, THOUGHT = "<think>", "</think>"
"""Some models write their reasoning into the text, between these."""
QUOTA = frozenset(
    {
        "insufficient_quota",
        "billing_hard_limit_reached",
        "credit_balance_exhausted",
        "organization_spend_limit_exceeded",
        "project_spend_limit_exceeded",
        "organization_usage_limit_exceeded",
    }
)
"""Codes for an account without credit, which come with the status of a rate limit.
Source: OpenAI's guide to error codes."""
CODES = {
    "model_not_found": Failure.MODEL_NOT_FOUND,
    "invalid_api_key": Failure.BAD_CREDENTIALS,
}
OVERFLOW = ("maximum context length", "reduce the length of the messages")
"""Phrases of OpenRouter, vLLM and Groq, which send no code for a conversation that is too long."""
OVERLOADED = ("overloaded", "over capacity")
TOO_MANY, UNAVAILABLE = (429, 529), 503
"""HTTP's statuses for a limit of requests, and for being unavailable for whatever reason."""


class AnswerReader:
    """Reader of one provider's answers.

    Args:
        url: Base URL of the API, which determines how tokens are counted.
    """

    def __init__(self, url: str) -> None:
        snapshot = get_snapshot()
        self._counters = [snapshot.find_provider(None, "openai", None)]
        with suppress(LookupError):
            self._counters.insert(0, snapshot.find_provider(None, None, url))

    def read(self, status: int, headers: Mapping[str, str], text: bytes) -> Completion:
        """Return the completion in an answer.

        Raises:
            ProviderError: It is an error, or not a chat completion.
        """
        if HTTPStatus.MULTIPLE_CHOICES <= status < HTTPStatus.BAD_REQUEST:
            raise redirect_error(status, headers.get("location"))
        if status >= HTTPStatus.BAD_REQUEST:
            raise convert_error(status, headers, text)
        answer = None
        try:
            answer = read_json(text)
            return self._completion(answer)
        except UNREADABLE as error:
            raise ProviderError(
                f"the answer (HTTP {status}) is not a chat completion: "
                f"{type(error).__name__}: {error}",
                Failure.GARBAGE,
                usage=self._usage_in(answer),
            ) from error

    def _completion(self, answer: Any) -> Completion:
        if "model" not in answer:
            raise KeyError("model")
        reply = replace(
            _reply(answer["choices"][0]),
            usage=self._usage_in(answer),
            provider_request_id=answer["id"],
            system_fingerprint=answer.get("system_fingerprint"),
        )
        return bounded(reply)

    def _usage_in(self, answer: Any) -> Usage:
        """Return the use; one request if the provider's figures are unreadable."""
        usage = answer.get("usage") if isinstance(answer, dict) else None
        if not isinstance(usage, dict):
            return ONE_REQUEST
        details = usage.get("completion_tokens_details")
        reasoning = details.get("reasoning_tokens") if isinstance(details, dict) else 0
        counted = {"model": "", "usage": _without_nulls(usage)}
        for counter in self._counters:
            # Not every provider of the snapshot is known to use this protocol.
            with suppress(LookupError, *UNREADABLE):
                _, used = counter.extract_usage(counted, api_flavor="chat")
                return usage_of(
                    used.input_tokens, used.output_tokens, used.cache_read_tokens, reasoning
                )
        return ONE_REQUEST


def _without_nulls(usage: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _without_nulls(value) if isinstance(value, dict) else value
        for name, value in usage.items()
        if value is not None
    }


def _reply(choice: Mapping[str, Any]) -> Completion:
    message, finish = choice["message"], choice.get("finish_reason")
    refusal = message.get("refusal")
    if finish == "" or not isinstance(finish, str | None) or not isinstance(refusal, str | None):
        raise TypeError(f"finish_reason is {finish!r} and refusal {refusal!r}")
    if refusal:
        return Completion(text="", finish="content_filter")
    return Completion(
        text=_without_thoughts(_content(message.get("content") or "")),
        calls=tuple(_call(call) for call in (message.get("tool_calls") or ())[:MAX_CALLS]),
        finish=FINISH.get(finish or "stop", "stop"),
    )


def _content(content: Any) -> str:
    """Return the text of a message; some providers send it in parts."""
    if isinstance(content, str):
        return content
    if not isinstance(content, list):
        raise TypeError(f"content is {type(content).__name__}")
    texts = [
        part["text"] if isinstance(part, dict) and part.get("type") == "text" else part
        for part in content
    ]
    return "".join(text for text in texts if isinstance(text, str))


def _without_thoughts(text: str) -> str:
    """Return a text without the thoughts marked in it; thoughts without an end are text."""
    spoken, place = [], 0
    while (start := text.find(THINKING, place)) >= 0:
        spoken.append(text[place:start])
        place = start + len(THINKING)
        end = text.find(THOUGHT, place)
        if end < 0:
            break
        place = end + len(THOUGHT)
    return "".join(spoken) + text[place:]


def _call(call: Mapping[str, Any]) -> ToolCall:
    id_, function = call["id"], call["function"]
    if call["type"] != "function" or id_ is None:
        raise ValueError(f"a tool call of type {call['type']!r} with id {id_!r}")
    return ToolCall(
        id=id_ or f"call_{uuid.uuid4().hex}",
        name=function["name"],
        arguments=arguments_of(function["arguments"]),
    )


def convert_error(status: int, headers: Mapping[str, str], text: bytes) -> ProviderError:
    """Return the failure that an error answer means, by its code, text or status."""
    body_text = text.decode(errors="replace")
    try:
        body = read_json(body_text)
    except ValueError:
        body = None
    error = body.get("error", body) if isinstance(body, dict) else None
    error = error if isinstance(error, dict) else {}
    code = error.get("code")
    names = [name for name in (code, error.get("type")) if isinstance(name, str)]
    overloaded = any(phrase in name.lower() for phrase in OVERLOADED for name in names)
    failure = failure_of_status(status)
    if not QUOTA.isdisjoint(names):
        failure, overloaded = Failure.QUOTA_EXCEEDED, False
    elif code == "context_length_exceeded" or _says(body_text, OVERFLOW):
        failure, overloaded = Failure.CONTEXT_OVERFLOW, False
    elif overloaded:
        failure = failure if failure is Failure.OUTAGE else Failure.REQUEST_REFUSED
    elif isinstance(code, str) and code in CODES:
        failure = CODES[code]
    elif status == HTTPStatus.FORBIDDEN and _flagged(error.get("metadata")):
        failure = Failure.REQUEST_REFUSED
    else:
        overloaded = status in TOO_MANY or (status == UNAVAILABLE and _says(body_text, OVERLOADED))
    message = error.get("message") or body_text.strip() or "no reason given"
    return ProviderError(
        f"HTTP {status}: {message}", failure, overloaded=overloaded, headers=headers
    )


def _says(text: str, phrases: tuple[str, ...]) -> bool:
    return any(phrase in text.lower() for phrase in phrases)


def _flagged(metadata: Any) -> bool:
    """Return whether an error is a moderation's, which OpenRouter reports like a bad key."""
    return isinstance(metadata, dict) and bool({"flagged_input", "reasons"} & metadata.keys())
