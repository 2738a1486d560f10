"""Dialogues: roles take turns in a shared thread, some of them with tools.

Each role sees its own replies as the assistant's and all others' as the user's. The next role
reads the answers of tools.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from buildarena_backend.journal.transcript import ActionResult
from buildarena_benchmark.environment.tools import LOOKUPS, OBJECTION, refuse_malformed
from buildarena_geometry import Outcome, Refused, ToolDefinition
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session

_LAST_LINE = re.compile(r"(?:^|\n)[\s*_`'\"#]*TERMINATE[\s*_`'\".!]*\Z")
NO_REPLY = "(no answer)"
MAX_STORED_MESSAGE = 40_000
"""Characters of a message to a role that the journal stores."""

Act = Callable[[str, Any], Outcome]
"""Executes an action by its name and arguments, like `Machine.act`."""


def terminates(reply: Completion) -> bool:
    """Return whether a reply ends its stage: TERMINATE alone on its last line, without a call.

    The word elsewhere in a reply ends nothing.
    """
    return not reply.calls and _LAST_LINE.search(reply.text) is not None


def is_lookup_only(reply: Completion) -> bool:
    """Return whether a reply only looks up modules; other roles do not read it."""
    return bool(reply.calls) and all(call.name in LOOKUPS for call in reply.calls)


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """A participant of a dialogue.

    Attributes:
        name: Role name.
        system: Its system message.
        tools: Tools that the role may use.
        act: Executes the role's tool calls.
        brief: First message, in place of the dialogue's opening.
        forgets: Whether the role reads only the opening and the messages since the last one of
            another role.
    """

    name: str
    system: str
    tools: Sequence[ToolDefinition] = ()
    act: Act | None = None
    brief: str = ""
    forgets: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Utterance:
    role: str
    reply: Completion
    actions: Sequence[ActionResult]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Remark:
    """A message of the session to one role."""

    to: str
    text: str


@dataclass(slots=True, eq=False)
class Dialogue:
    """A thread of roles' replies.

    Messages are never removed: a role's view only grows, so that providers can cache it, and its
    replies alternate with what it reads, as strict chat templates require. The view of a role that
    forgets restarts with each message of another role.

    Attributes:
        phase: The workflow's phase, for journal and transcript.
        opening: First message of every role without a brief.
        sub_structure: Name of the sub-structure it is about, if any.
    """

    session: Session
    phase: str
    opening: str
    sub_structure: str | None = None
    _thread: list[_Utterance | _Remark] = field(default_factory=list, init=False)

    def remark(self, role: Role, text: str) -> None:
        """Add a message to one role's view."""
        self._thread.append(_Remark(to=role.name, text=text))

    @property
    def acted(self) -> bool:
        """True if the last reply carried out an action."""
        last = self._thread[-1] if self._thread else None
        return isinstance(last, _Utterance) and any(action.ok for action in last.actions)

    def turn(self, role: Role) -> Completion:
        """Request a role's reply, and execute the tool it calls.

        Raises:
            ConstructionFailedError: The role raised an objection.
        """
        request = Request(
            model_config=self.session.model_config,
            messages=self._view(role),
            tools=role.tools,
            seed=self.session.seed,
            new_messages=self._new_messages(role),
            phase=self.phase,
            role=role.name,
        )
        reply = self.session.ask(request)
        actions = _execute_calls(role, reply)
        self._thread.append(_Utterance(role=role.name, reply=reply, actions=actions))
        self.session.record(request, reply, actions, self.sub_structure)
        for action in actions:
            if action.name == OBJECTION.name and action.ok:
                raise ConstructionFailedError("objection", f"{role.name}: {action.feedback}")
        return reply

    def _view(self, role: Role) -> list[Message]:
        messages = [Message(role="system", text=role.system)]
        received = [role.brief or self.opening]
        for entry in self._thread[self._beginning(role) :]:
            if isinstance(entry, _Remark):
                received += [entry.text] if entry.to == role.name else []
            elif entry.role == role.name:
                self._add_received(messages, received)
                messages += _own(entry)
                received = []
            elif not (is_lookup_only(entry.reply) and all(action.ok for action in entry.actions)):
                received.append(_format(entry))
        self._add_received(messages, received)
        return messages

    def _new_messages(self, role: Role) -> dict[str, Any] | None:
        """Return the session's new messages to a role in the journal's form; None without any."""
        begun, remarks = False, list[str]()
        for entry in self._thread:
            if isinstance(entry, _Utterance) and entry.role == role.name:
                begun, remarks = True, []
            elif isinstance(entry, _Remark) and entry.to == role.name:
                remarks.append(entry.text)
        first = [] if begun else [role.brief or self.opening]
        told = {"user": [text[:MAX_STORED_MESSAGE] for text in [*first, *remarks]]}
        if begun:
            return told if remarks else None
        return {**told, "system": role.system[:MAX_STORED_MESSAGE]}

    def _beginning(self, role: Role) -> int:
        """Return the index of the first entry of the thread that a role reads."""
        if not role.forgets:
            return 0
        others = [isinstance(e, _Utterance) and e.role != role.name for e in self._thread]
        return max((index for index, is_other in enumerate(others) if is_other), default=0)

    def _add_received(self, messages: list[Message], received: Sequence[str]) -> None:
        """Add what was received; ask a role that spoke last and received nothing to continue."""
        if not received and messages[-1].role == "assistant":
            received = [self.session.say("go_on")]
        if received:
            messages.append(Message(role="user", text="\n\n".join(received)))


def _own(utterance: _Utterance) -> list[Message]:
    own = [Message(role="assistant", text=utterance.reply.text, calls=utterance.reply.calls)]
    if not utterance.reply.text and not utterance.reply.calls:
        own = [Message(role="assistant", text=NO_REPLY)]
    own += [
        Message(role="tool", text=action.feedback, call_id=call.id, tool=call.name)
        for call, action in zip(utterance.reply.calls, utterance.actions, strict=True)
    ]
    return own


def _format(utterance: _Utterance) -> str:
    parts = [utterance.reply.text] if utterance.reply.text else []
    parts += [_format_action(action) for action in utterance.actions]
    return f"[{utterance.role}] " + ("\n".join(parts) or NO_REPLY)


def _format_action(action: ActionResult) -> str:
    """Return the feedback of an action, with the call if it was refused."""
    if action.ok:
        return action.feedback
    written = str(action.arguments)
    if isinstance(action.arguments, dict):
        written = ", ".join(f"{name}={value!r}" for name, value in action.arguments.items())
    return f"{action.name}({written}): {action.feedback}"


def _execute_calls(role: Role, reply: Completion) -> list[ActionResult]:
    if len(reply.calls) > 1:
        text = "One tool call per reply; of these nothing was done."
        return [_result(call, text, "parallel_calls") for call in reply.calls]
    return [_execute(role, call) for call in reply.calls]


def _execute(role: Role, call: ToolCall) -> ActionResult:
    if call.name not in {tool.name for tool in role.tools}:
        names = ", ".join(tool.name for tool in role.tools) or "none"
        text = f"There is no tool {call.name!r}. Tools: {names}."
        return _result(call, text, "unknown_action")
    if call.name == OBJECTION.name:
        refusal = refuse_malformed(OBJECTION, call.arguments)
        if refusal is not None:
            return _result(call, refusal.text, refusal.reason.value)
        return _result(call, call.arguments["reason"])
    assert role.act is not None, "a role with machine tools has a handler"  # noqa: S101 - ours
    outcome = role.act(call.name, call.arguments)
    return _result(
        call, outcome.text, outcome.reason.value if isinstance(outcome, Refused) else None
    )


def _result(call: ToolCall, feedback: str, refusal: str | None = None) -> ActionResult:
    return ActionResult(
        name=call.name,
        arguments=call.arguments,
        ok=refusal is None,
        reason=refusal,
        feedback=feedback,
    )
