"""Transcripts as Markdown, for people."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

FENCE = "```"


def as_markdown(data: bytes, title: str) -> str:
    """A kept transcript as a page.

    Args:
        data: The JSON document that is kept as the artifact.
        title: Heading of the page.
    """
    turns: list[dict[str, Any]] = json.loads(data)["turns"]
    lines = [f"# {title}", "", _summary(turns), ""]
    place: tuple[str, str | None] | None = None
    for turn in turns:
        here = (turn["stage"], turn.get("sub_structure"))
        if here != place:
            place = here
            lines += [f"## {here[0]}" + (f": {here[1]}" if here[1] else ""), ""]
        lines += _turn(turn)
    return "\n".join(lines)


def _summary(turns: list[dict[str, Any]]) -> str:
    actions = [action for turn in turns for action in turn["actions"]]
    refused = Counter(action["reason"] or "refused" for action in actions if not action["ok"])
    share = sum(refused.values()) / len(actions) if actions else 0.0
    rendered = ", ".join(f"{count} {name}" for name, count in refused.most_common()) or "none"
    return f"{len(turns)} turns, {len(actions)} actions, {share:.1%} of them refused ({rendered})."


def _turn(turn: dict[str, Any]) -> list[str]:
    cost = ""
    if "input_tokens" in turn:
        cost = (
            f" · {turn['input_tokens']:,} in, {turn['output_tokens']:,} out"
            f" · ${turn['cost_usd']} · {turn['latency_s']:.2f} s"
        )
    lines = [f"**{turn['index']} {turn['role']}**{cost}", ""]
    if turn["text"]:
        lines += [f"> {line}" for line in turn["text"].splitlines()] + [""]
    for action in turn["actions"]:
        mark = "accepted" if action["ok"] else f"refused: {action['reason']}"
        arguments = json.dumps(action["arguments"], ensure_ascii=False)
        lines += [f"`{action['name']}` {arguments} ({mark})", ""]
        lines += [FENCE, action["feedback"].replace(FENCE, "'''"), FENCE, ""]
    return lines
