"""Messages between a session and a model, in our own neutral form.

The form is what journals keep and request hashes are made of, so it does not change when a
provider's or a library's does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from buildarena_store import Usage
from buildarena_store.ids import content_hash
from buildarena_worker.session.request_options import UNBOUNDED, RequestOptions


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message of a conversation.

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
class Tool:
    """A tool that a model may use.

    Attributes:
        name: Its name.
        description: What it does, for the model.
        parameters: JSON schema of its arguments.
    """

    name: str
    description: str
    parameters: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What is sent to a model.

    Attributes:
        model_config: The job's model configuration.
        messages: The conversation.
        tools: Tools that may be used.
        seed: The job's seed, sent where providers take one.
    """

    model_config: Mapping[str, Any]
    messages: Sequence[Message]
    tools: Sequence[Tool] = ()
    seed: int = 0

    @property
    def hash(self) -> str:
        """SHA-256 of everything in it."""
        return content_hash(
            {
                "model": dict(self.model_config),
                "messages": [_plain(message) for message in self.messages],
                "tools": [[tool.name, tool.description, tool.parameters] for tool in self.tools],
                "seed": self.seed,
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What a model answered.

    Attributes:
        text: What it said.
        calls: Tools it wants to use.
        finish: Why it stopped: ``stop``, ``length``, ``tool_call``, ``content_filter``, ``error``;
            ``garbage`` and ``out_of_time`` stand for answers that can't be read or did not come.
    """

    text: str
    calls: Sequence[ToolCall] = field(default_factory=tuple)
    finish: str = "stop"

    def to_json(self) -> dict[str, Any]:
        """The form that journals keep."""
        return {
            "text": self.text,
            "calls": [[call.id, call.name, call.arguments] for call in self.calls],
            "finish": self.finish,
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Reply:
        """A reply from a journal."""
        calls = tuple(
            ToolCall(id=id_, name=name, arguments=arguments)
            for id_, name, arguments in data["calls"]
        )
        return Reply(text=data["text"], calls=calls, finish=data["finish"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Completion:
    """A reply with what it took to get it.

    Attributes:
        reply: The reply.
        usage: What it cost.
        latency_s: Time until it was there, retries included.
        attempts: Requests that it took.
        provider_request_id: The provider's own id of it, if it gave one.
    """

    reply: Reply
    usage: Usage
    latency_s: float
    attempts: int = 1
    provider_request_id: str | None = None


class ModelClient(Protocol):
    """Something that answers requests: a provider, a built-in model, a fake."""

    def complete(self, request: Request, options: RequestOptions = UNBOUNDED) -> Completion:
        """Asks the model.

        Args:
            request: What is asked.
            options: How long to wait for the answer. When its seconds are over, the answer is an
                empty one with the finish word ``out_of_time``; one that can't be read is an empty
                one with ``garbage``.

        Raises:
            CancelledError: The lease was lost.
            TransientError: The provider failed, after the declared retries.
            PermanentError: The provider will never answer, for example a bad key.
        """


def _plain(message: Message) -> list[Any]:
    calls = [[call.id, call.name, call.arguments] for call in message.calls]
    return [message.role, message.text, calls, message.call_id]
