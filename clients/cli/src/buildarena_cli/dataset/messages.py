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
    messages: list[dict[str, Any]] = []
    if statement is not None and not prompt_of:
        messages.append({"role": "user", "content": statement})
    for turn in turns:
        role = turn["role"]
        if prompt := prompt_of.get(turn["index"]):
            system = [] if prompt["system"] is None else [("system", prompt["system"])]
            for kind, text in [*system, *(("user", text) for text in prompt["user"])]:
                messages.append({"role": kind, "content": text, "name": role})
        calls, answers = [], []
        for number, action in enumerate(turn["actions"]):
            id_, name = f"call_{turn['index']}_{number}", action["name"]
            function = {"name": name, "arguments": compact(action["arguments"])}
            calls.append({"id": id_, "type": "function", "function": function})
            content = action["feedback"]
            answers.append({"role": "tool", "content": content, "name": name, "tool_call_id": id_})
        reply = {"role": "assistant", "content": turn["text"], "name": role}
        machine = turn.get("sub_structure")
        messages += [{**reply, "tool_calls": calls or None, "machine": machine}, *answers]
    return messages


def tools() -> str:
    """Return the definitions of all actions, and of the objection, as JSON."""
    offered = (tool.as_document() for tool in (*tool_definitions(), OBJECTION))
    return compact([{"type": "function", "function": tool} for tool in offered])
