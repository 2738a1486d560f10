"""Dialogues: roles that speak in turns about a shared thread, some of them with tools.

Each role sees the thread from its own side: its own replies as the assistant's, all others'
as the user's. A tool's answer is what the next role reads.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from buildarena_pipeline.transcript import ActionResult
from buildarena_worker.session.messages import Message, Reply, Tool, ToolCall
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session

TERMINATE = re.compile(r"\bTERMINATE\b")
NO_REPLY = "(no answer)"
OBJECTION = Tool(
    name="raise_objection",
    description="End the work as a failure because it cannot be done within the task's rules.",
    parameters={
        "type": "object",
        "properties": {"reason": {"type": "string", "description": "Why it cannot be done."}},
        "required": ["reason"],
        "additionalProperties": False,
    },
)

Act = Callable[[ToolCall], ActionResult]


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """Somebody who speaks in a dialogue.

    Attributes:
        name: Role name.
        system: Its system message.
        tools: Tools it may use.
        act: Carries out its tool calls.
    """

    name: str
    system: str
    tools: Sequence[Tool] = ()
    act: Act | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Utterance:
    role: str
    reply: Reply
    actions: Sequence[ActionResult]


class Dialogue:
    """A thread that roles add to.

    Args:
        session: The session it is part of.
        phase: The workflow's phase, for journal and transcript.
        opening: What every role reads first.
        sub_structure: What it is about, if it is one part of the machine.
    """

    def __init__(
        self, session: Session, *, phase: str, opening: str, sub_structure: str | None = None
    ) -> None:
        self._session = session
        self._phase = phase
        self._opening = opening
        self._sub_structure = sub_structure
        self._thread: list[_Utterance] = []

    def turn(self, role: Role, *, extra: str = "") -> Reply:
        """Lets a role speak and carries out the tool it calls.

        Args:
            role: Who speaks.
            extra: Something that only this role reads, and only now.

        Raises:
            ConstructionFailedError: The role raised an objection.
        """
        reply, entry = self._session.ask(
            self._view(role, extra), role.tools, phase=self._phase, role=role.name
        )
        actions = _carry_out(role, reply)
        self._thread.append(_Utterance(role=role.name, reply=reply, actions=actions))
        self._session.record(
            phase=self._phase,
            sub_structure=self._sub_structure,
            role=role.name,
            reply=reply,
            entry=entry,
            actions=actions,
        )
        for action in actions:
            if action.name == OBJECTION.name and action.ok:
                raise ConstructionFailedError("objection", f"{role.name}: {action.feedback}")
        return reply

    def _view(self, role: Role, extra: str) -> list[Message]:
        messages = [Message(role="system", text=role.system)]
        received = [self._opening]
        for utterance in self._thread:
            if utterance.role == role.name:
                messages += _joined(received)
                messages += _own(utterance)
                received = []
            else:
                received.append(_rendered(utterance))
        if extra:
            received.append(extra)
        return messages + _joined(received)


def _joined(received: list[str]) -> list[Message]:
    return [Message(role="user", text="\n\n".join(received))] if received else []


def _own(utterance: _Utterance) -> list[Message]:
    own = [Message(role="assistant", text=utterance.reply.text, calls=utterance.reply.calls)]
    if not utterance.reply.text and not utterance.reply.calls:
        own = [Message(role="assistant", text=NO_REPLY)]
    own += [
        Message(role="tool", text=action.feedback, call_id=call.id, tool=call.name)
        for call, action in zip(utterance.reply.calls, utterance.actions, strict=True)
    ]
    return own


def _rendered(utterance: _Utterance) -> str:
    parts = [utterance.reply.text] if utterance.reply.text else []
    parts += [
        f"{action.name}({_rendered_arguments(action.arguments)}): {action.feedback}"
        for action in utterance.actions
    ]
    return f"[{utterance.role}] " + ("\n".join(parts) or NO_REPLY)


def _rendered_arguments(arguments: object) -> str:
    if isinstance(arguments, dict):
        return ", ".join(f"{name}={value!r}" for name, value in arguments.items())
    return str(arguments)


def _carry_out(role: Role, reply: Reply) -> list[ActionResult]:
    calls = reply.calls
    if not calls:
        return []
    if len(calls) > 1:
        text = "One tool call per reply; of these nothing was done."
        return [_refused(call, "parallel_calls", text) for call in calls]
    call = calls[0]
    if call.name not in {tool.name for tool in role.tools}:
        names = ", ".join(tool.name for tool in role.tools) or "none"
        return [
            _refused(call, "unknown_action", f"There is no tool {call.name!r}. Tools: {names}.")
        ]
    if call.name == OBJECTION.name:
        reason = call.arguments.get("reason") if isinstance(call.arguments, dict) else None
        return [
            ActionResult(
                name=call.name,
                arguments=call.arguments,
                ok=True,
                reason=None,
                feedback=str(reason or "no reason given"),
            )
        ]
    assert role.act is not None, "a role with machine tools carries them out"  # noqa: S101 - ours
    return [role.act(call)]


def _refused(call: ToolCall, reason: str, text: str) -> ActionResult:
    return ActionResult(
        name=call.name, arguments=call.arguments, ok=False, reason=reason, feedback=text
    )
