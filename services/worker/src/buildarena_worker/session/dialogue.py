"""Dialogues: roles that speak in turns about a shared thread, some of them with tools.

Each role sees the thread from its own side: its own replies as the assistant's, all others'
as the user's. A tool's answer is what the next role reads.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from buildarena_worker.errors import ConstructionFailedError
from buildarena_worker.session.messages import Message, Reply, Tool, ToolCall
from buildarena_worker.session.session import Session
from buildarena_worker.session.transcript import ActionRecord

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

Act = Callable[[ToolCall], ActionRecord]


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
class _Said:
    role: str
    reply: Reply
    actions: Sequence[ActionRecord]


class Dialogue:
    """A thread that roles add to.

    Args:
        session: The session it is part of.
        stage: Stage name for journal and transcript.
        opening: What every role is told first.
        sub_structure: What it is about, if it is one part of the machine.
    """

    def __init__(
        self, session: Session, *, stage: str, opening: str, sub_structure: str | None = None
    ) -> None:
        self._session = session
        self._stage = stage
        self._opening = opening
        self._sub_structure = sub_structure
        self._thread: list[_Said] = []

    def turn(self, role: Role, *, also: str = "") -> Reply:
        """Lets a role speak and carries out the tool it calls.

        Args:
            role: Who speaks.
            also: Something that only this role is told now.

        Raises:
            ConstructionFailedError: The role raised an objection.
        """
        reply, entry = self._session.ask(
            self._view(role, also), role.tools, stage=self._stage, role=role.name
        )
        actions = _carry_out(role, reply)
        self._thread.append(_Said(role=role.name, reply=reply, actions=actions))
        self._session.record(
            stage=self._stage,
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

    def _view(self, role: Role, also: str) -> list[Message]:
        messages = [Message(role="system", text=role.system)]
        heard = [self._opening]
        for said in self._thread:
            if said.role == role.name:
                messages += _flush(heard)
                messages += _own(said)
                heard = []
            else:
                heard.append(_heard(said))
        if also:
            heard.append(also)
        return messages + _flush(heard)


def _flush(heard: list[str]) -> list[Message]:
    return [Message(role="user", text="\n\n".join(heard))] if heard else []


def _own(said: _Said) -> list[Message]:
    own = [Message(role="assistant", text=said.reply.text, calls=said.reply.calls)]
    if not said.reply.text and not said.reply.calls:
        own = [Message(role="assistant", text=NO_REPLY)]
    own += [
        Message(role="tool", text=action.feedback, call_id=call.id, tool=call.name)
        for call, action in zip(said.reply.calls, said.actions, strict=True)
    ]
    return own


def _heard(said: _Said) -> str:
    parts = [said.reply.text] if said.reply.text else []
    parts += [
        f"{action.name}({_spelled(action.arguments)}): {action.feedback}" for action in said.actions
    ]
    return f"[{said.role}] " + ("\n".join(parts) or NO_REPLY)


def _spelled(arguments: object) -> str:
    if isinstance(arguments, dict):
        return ", ".join(f"{name}={value!r}" for name, value in arguments.items())
    return str(arguments)


def _carry_out(role: Role, reply: Reply) -> list[ActionRecord]:
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
            ActionRecord(
                name=call.name,
                arguments=call.arguments,
                ok=True,
                reason=None,
                feedback=str(reason or "no reason given"),
            )
        ]
    assert role.act is not None, "a role with machine tools carries them out"  # noqa: S101 - ours
    return [role.act(call)]


def _refused(call: ToolCall, reason: str, text: str) -> ActionRecord:
    return ActionRecord(
        name=call.name, arguments=call.arguments, ok=False, reason=reason, feedback=text
    )
