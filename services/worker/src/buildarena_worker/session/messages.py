"""Messages between a session and a model, in our own neutral form.

The form is what journals keep and request hashes are made of, so it does not change when a
provider's or a library's does.
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
    """A tool that a model wants to use.

    Attributes:
        id: Ties the call to its result.
        name: Tool name, as the model spelled it.
        arguments: What the model gave: an object, or any text that is not a JSON object.
    """

    id: str
    name: str
    arguments: Any

    @property
    def arguments_json(self) -> str:
        """The arguments as JSON: an object, even when the model gave something else.

        Providers accept nothing else in a conversation.
        """
        arguments = self.arguments if isinstance(self.arguments, dict) else {"text": self.arguments}
        return json.dumps(arguments, ensure_ascii=False, separators=(",", ":"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """A message of a conversation.

    Attributes:
        role: ``system``, ``user``, ``assistant`` or ``tool``.
        text: What is said, or a tool's answer.
        calls: Tools that an assistant message uses.
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
        told: The messages that the session itself adds with this request; a part of nothing that
            is sent, as `messages` has them already.
    """

    model_config: Mapping[str, Any]
    messages: Sequence[Message]
    tools: Sequence[ToolDefinition] = ()
    seed: int = 0
    told: Sequence[Message] = ()

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
    """A model's reply, with what it took to get it.

    Attributes:
        text: What it said.
        calls: Tools it wants to use.
        finish: Why it stopped: ``stop``, ``length``, ``tool_call``, ``content_filter``, ``error``;
            ``garbage`` and ``out_of_time`` stand for replies that can't be read or did not come.
        usage: What it used; a protocol leaves the price to the client.
        latency_s: Time until it was there, retries included.
        attempts: Requests that it took.
        provider_request_id: The provider's own id of it, if it gave one.
        system_fingerprint: The provider's name of its configuration, if it gave one.
        failures: Why earlier sendings failed, a text each.
        sequence: Its place in the session's journal, from 0; known to the session's host.
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
        within_s: The seconds that the job's limit leaves for it.
        active: The lease that it is wanted under.
        owner: Whose request it is; empty for the operator's.
        sent: Set as soon as the request may cost something.
    """

    within_s: float = math.inf
    active: ActiveLease | None = None
    owner: str = ""
    sent: threading.Event = field(default_factory=threading.Event)


UNBOUNDED = RequestOptions()


class ModelClient(Protocol):
    """Something that answers requests: a provider, a built-in model, a fake."""

    def complete(self, request: Request, options: RequestOptions = UNBOUNDED) -> Completion:
        """Ask the model.

        Args:
            options: How long to wait for the answer. When its seconds are over, the answer is an
                empty one with the finish word ``out_of_time``; one that can't be read is an empty
                one with ``garbage``.

        Raises:
            CancelledError: The lease was lost.
            TransientError: The provider failed, after the declared retries.
            PermanentError: The provider will never answer, for example a bad key.
        """


def _plain(message: Message) -> list[Any]:
    return [message.role, message.text, _plain_calls(message.calls), message.call_id]


def _plain_calls(calls: Sequence[ToolCall]) -> list[list[Any]]:
    return [[call.id, call.name, call.arguments] for call in calls]
