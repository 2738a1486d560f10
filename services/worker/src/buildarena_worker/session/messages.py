"""Messages between a session and a model, in a neutral form.

Journals and request hashes use this form, so it does not change when a provider's or a library's
does.
"""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from buildarena_backend.ids import content_hash
from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_geometry import ToolDefinition

ONE_REQUEST = Usage(requests=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolCall:
    """A model's call of a tool.

    Attributes:
        id: Identifier that links the call to its result.
        name: Tool name, as the model spelled it.
        arguments: A JSON object, or text that is not one.
    """

    id: str
    name: str
    arguments: Any

    @property
    def arguments_json(self) -> str:
        """The arguments as a JSON object, even when the model sent something else.

        Providers accept nothing else in a conversation.
        """
        arguments = self.arguments if isinstance(self.arguments, dict) else {"text": self.arguments}
        return json.dumps(arguments, ensure_ascii=False, separators=(",", ":"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """A message of a conversation.

    Attributes:
        role: ``system``, ``user``, ``assistant`` or ``tool``.
        text: Text of the message, or a tool's answer.
        calls: Tool calls of an assistant message.
        call_id: The call that a tool message answers.
        tool: The tool that a tool message comes from.
    """

    role: str
    text: str
    calls: Sequence[ToolCall] = ()
    call_id: str | None = None
    tool: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Request to a model.

    Attributes:
        model_config: The job's model configuration.
        tools: Tools that may be used.
        seed: The job's seed, sent where providers take one.
        new_messages: The session's new messages in `messages`, in the journal's form: "user" texts,
            and "system" at the beginning; None without any.
        phase: The workflow's phase.
        role: Name of the role that asks.
    """

    model_config: Mapping[str, Any]
    messages: Sequence[Message]
    tools: Sequence[ToolDefinition] = ()
    seed: int = 0
    new_messages: Mapping[str, Any] | None = None
    phase: str = ""
    role: str = ""

    @property
    def hash(self) -> str:
        """SHA-256 of everything that is sent."""
        return content_hash(
            {
                "model": dict(self.model_config),
                "messages": [_plain(message) for message in self.messages],
                "tools": [[tool.name, tool.description, tool.parameters] for tool in self.tools],
                "seed": self.seed,
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Completion:
    """A model's reply, with its cost.

    Attributes:
        finish: Reason to stop: ``stop``, ``length``, ``tool_call``, ``content_filter``, ``error``;
            ``garbage`` and ``out_of_time`` mark replies that can't be read or did not arrive.
        usage: Tokens and requests; the client adds the price.
        latency_s: Time until the reply arrived, retries included.
        attempts: Number of requests, retries included.
        provider_request_id: The provider's id of the reply, if any.
        system_fingerprint: The provider's name of its configuration, if any.
        failures: Error messages of earlier attempts.
        sequence: Index in the session's journal, from 0; set by the session's host.
    """

    text: str
    calls: Sequence[ToolCall] = ()
    finish: str = "stop"
    usage: Usage = ONE_REQUEST
    latency_s: float = 0.0
    attempts: int = 1
    provider_request_id: str | None = None
    system_fingerprint: str | None = None
    failures: Sequence[str] = ()
    sequence: int = 0

    def to_json(self) -> dict[str, Any]:
        """Return the reply as journals store it."""
        return {"text": self.text, "calls": _plain_calls(self.calls), "finish": self.finish}

    @staticmethod
    def from_entry(entry: JournalEntry) -> Completion:
        """Return the completion of an entry in a journal."""
        return Completion(
            text=entry.reply["text"],
            calls=tuple(
                ToolCall(id=id_, name=name, arguments=arguments)
                for id_, name, arguments in entry.reply["calls"]
            ),
            finish=entry.reply["finish"],
            usage=entry.usage,
            latency_s=entry.latency_s,
            attempts=entry.tries,
            provider_request_id=entry.provider_request_id,
            sequence=entry.sequence,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestOptions:
    """Conditions that end the wait for an answer; none by default.

    Attributes:
        within_s: Remaining time of the job, seconds.
        active: Lease that the request belongs to.
        owner: API key that pays for the request; empty for the operator's.
        sent: Set as soon as the request may cost something.
    """

    within_s: float = math.inf
    active: ActiveLease | None = None
    owner: str = ""
    sent: threading.Event = field(default_factory=threading.Event)


UNBOUNDED = RequestOptions()


class ModelClient(Protocol):
    """Client that answers requests: a provider, a built-in model, a fake."""

    def complete(self, request: Request, options: RequestOptions = UNBOUNDED) -> Completion:
        """Return the model's reply.

        When the options' time is over, the reply is empty and its `finish` is ``out_of_time``; for
        one that can't be read it is ``garbage``.

        Raises:
            CancelledError: The lease was lost.
            TransientError: The provider failed, after the declared retries.
            PermanentError: The provider will never answer, for example a bad key.
        """


def _plain(message: Message) -> list[Any]:
    return [message.role, message.text, _plain_calls(message.calls), message.call_id]


def _plain_calls(calls: Sequence[ToolCall]) -> list[list[Any]]:
    return [[call.id, call.name, call.arguments] for call in calls]
