"""A model that writes construction trees from nothing but its prompts: a bridge and a car.

It knows how such machines are laid out. The form of a tree, the numbers of modules and of their
building points, and what the task asks for it takes from what it reads; where that is not said, it
gives up.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import Any

from support.providers.engineer import Told

from buildarena_store import Usage
from buildarena_worker.session.messages import Completion, Request

BLOCK, WHEEL, BRACE = "Small Wooden Block", "Powered Wheel", "Brace"
OVERLAP = 4
"""Blocks that a brace spans."""
SPINE = 2
"""Blocks before and behind the middle of a car."""
PLAN = """<building_plan>
<overall_structure>A car: a spine with a wheel at each of its four corners.</overall_structure>
<sub_structures>
<sub_structure><name>spine</name><description>a row of 5 blocks</description></sub_structure>
<sub_structure><name>wheels</name><description>4 wheels at its ends</description></sub_structure>
</sub_structures>
</building_plan>"""
FAULT = "Nothing but single joints bears the load at the middle: join the blocks by braces above."


@dataclass
class Tree:
    """A tree, written with the numbers that a prompt tells."""

    told: str
    entries: list[dict[str, Any]] = field(default_factory=list)

    def type_of(self, module: str) -> int:
        """A module's number."""
        return int(self._find(rf"{module} \((\d+)\)"))

    def point(self, module: str, side: str) -> int:
        """The number of a module's point on a side."""
        return int(self._find(rf"^- .*{module} \(\d+\).*?: .*?(\d+) {side} \["))

    def start(self) -> int:
        """The starting block."""
        return self._add({"type": self.type_of("Starting Block"), "parent": -1, "face_id": -1})

    def put(self, parent: int, side: str, module: str) -> int:
        """A block on a side of an entry."""
        face = self.point(self._module(parent), side)
        return self._add({"type": self.type_of(module), "parent": parent, "face_id": face})

    def brace(self, first: int, second: int, side: str) -> int:
        """A brace between the same side of two entries."""
        ends = {
            key: value
            for end, entry in (("a", first), ("b", second))
            for key, value in (
                (f"parent_{end}", entry),
                (f"face_id_{end}", self.point(self._module(entry), side)),
            )
        }
        return self._add({"type": self.type_of(BRACE), **ends})

    def row(self, side: str, length: int) -> list[int]:
        """Blocks from one side of the starting block on."""
        row = [self.put(0, side, BLOCK)]
        while len(row) < length:
            row.append(self.put(row[-1], "front", BLOCK))
        return row

    def reply(self) -> str:
        """The reply with the tree."""
        rows = ",\n ".join(json.dumps(entry) for entry in self.entries)
        return f"As computed.\n\n```json\n[{rows}]\n```"

    def _add(self, entry: dict[str, Any]) -> int:
        self.entries.append({"id": len(self.entries), **entry})
        return len(self.entries) - 1

    def _module(self, number: int) -> str:
        return BLOCK if number else "Starting Block"

    def _find(self, pattern: str) -> str:
        match = re.search(pattern, self.told.partition("## Building points")[2], re.MULTILINE)
        if match is None:
            raise LookupError(f"the prompt does not say {pattern!r}")
        return match.group(1)


class TreeEngineer:
    """Plays all roles of the tree workflows, and the controller."""

    def __init__(self) -> None:
        self.requests: list[Request] = []

    def complete(self, request: Request, options: object = None) -> Completion:
        """Its next reply."""
        del options
        self.requests.append(request)
        usage = Usage(requests=1, input_tokens=10, output_tokens=5)
        return Completion(text=_reply(request), usage=usage)


def _reply(request: Request) -> str:
    system, opening = request.messages[0].text, request.messages[1].text
    role = system.partition("# Role: ")[2].split(maxsplit=1)[0]
    if role == "planner":
        return PLAN
    if role == "inspector":
        return "Nothing is left.\nTERMINATE" if '"parent_a"' in opening else FAULT
    if role == "controller":
        return _driven(opening)
    if '"face_id"' not in system:
        raise LookupError("the prompt does not say how an entry is written")
    if "# Build a bridge" in opening:
        return _bridge(opening, braced="## Inspection" in opening)
    part = re.search(r"^## Part to add: (\w+)$", opening, re.MULTILINE)
    return _car(opening, wheels=part is None or part.group(1) == "wheels")


def _bridge(told: str, *, braced: bool) -> str:
    tree = Tree(told)
    half = int(Told(told).number("gap that is # units wide")) // 2 + 1
    middle = tree.start()
    ahead, behind = tree.row("front", half), tree.row("back", half)
    row = [*reversed(behind), middle, *ahead]
    if braced:
        for side in ("up", "down"):
            for first, second in zip(row, row[OVERLAP:], strict=False):
                tree.brace(first, second, side)
    return tree.reply()


def _car(told: str, *, wheels: bool) -> str:
    if "At least four powered wheels" not in told:
        raise LookupError("the prompt does not ask for a car")
    tree = Tree(told)
    tree.start()
    ends = [tree.row("front", SPINE)[-1], tree.row("back", SPINE)[-1]]
    if wheels:
        for end in ends:
            for side in ("left", "right"):
                tree.put(end, side, WHEEL)
    return tree.reply()


def _driven(told: str) -> str:
    wheels = re.findall(r"^(\d+) Powered Wheel", told, re.MULTILINE)
    bound = [
        {"block": block, "action": "spinning_forward", "keys": ["UpArrow"]} for block in wheels
    ]
    pressed = [{"time": 1.0, "key": "UpArrow", "hold_for": 10.0}]
    return json.dumps(
        {"control_design": "ahead", "control_config": bound, "control_sequence": pressed}
    )
