"""Sessions as chats, in the form of training libraries."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from buildarena_benchmark.environment.tools import OBJECTION
from buildarena_geometry import tool_definitions


def compact(value: Any) -> str:
    """Return the canonical text of a JSON value."""
    return json.dumps(value, ensure_ascii=False, sort_keys=True, separators=(",", ":"))


def chat(
    statement: str | None,
    turns: Iterable[Mapping[str, Any]],
    prompts: Iterable[Mapping[str, Any]] = (),
) -> list[dict[str, Any]]:
    """Return a session as messages.

    Args:
        statement: The task's statement; None if the service no longer has it.
        turns: Turns of the transcript.
        prompts: The session's messages to its roles, as the service returns them; none for agents.

    Returns:
        The session's messages before each turn as the system's and the user's, or else the
        statement as the user's; then the reply as the assistant's, and each tool's answer.
    """
    prompt_of = {prompt["turn"]: prompt for prompt in prompts}
    messages = [] if prompt_of or statement is None else [_message("user", statement)]
    for turn in turns:
        messages += _prompt_messages(prompt_of.get(turn["index"]), turn["role"])
        calls = [
            (f"call_{turn['index']}_{number}", action)
            for number, action in enumerate(turn["actions"])
        ]
        asked = [
            {"id": id_, "type": "function", "function": _function(action)} for id_, action in calls
        ]
        messages.append(
            _message(
                "assistant",
                turn["text"],
                name=turn["role"],
                tool_calls=asked or None,
                machine=turn.get("sub_structure"),
            )
        )
        messages += [
            _message("tool", action["feedback"], name=action["name"], tool_call_id=id_)
            for id_, action in calls
        ]
    return messages


def _prompt_messages(prompt: Mapping[str, Any] | None, role: str) -> list[dict[str, Any]]:
    if prompt is None:
        return []
    system = [] if prompt["system"] is None else [_message("system", prompt["system"], name=role)]
    return system + [_message("user", text, name=role) for text in prompt["user"]]


def tools() -> str:
    """Return the definitions of all actions, and of the objection, as JSON."""
    offered = (tool.as_document() for tool in (*tool_definitions(), OBJECTION))
    return compact([{"type": "function", "function": tool} for tool in offered])


def _message(
    role: str,
    content: str,
    *,
    name: str | None = None,
    tool_calls: list[dict[str, Any]] | None = None,
    tool_call_id: str | None = None,
    machine: str | None = None,
) -> dict[str, Any]:
    return {
        "role": role,
        "content": content,
        "name": name,
        "tool_calls": tool_calls,
        "tool_call_id": tool_call_id,
        "machine": machine,
    }


def _function(action: Mapping[str, Any]) -> dict[str, str]:
    return {"name": action["name"], "arguments": compact(action["arguments"])}
