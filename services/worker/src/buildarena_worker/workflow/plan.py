"""Building plans: the planner's answer, read leniently, because models write loose XML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

PARTS = (
    "description",
    "components",
    "assembly",
    "motion_control",
    "function",
    "design_requirements",
)


class PlanError(ValueError):
    """The text holds no plan; the message tells the model what is missing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SubStructure:
    """A part of the machine that is built on its own.

    Attributes:
        name: Unique in its plan.
        text: What the plan says of it.
    """

    name: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Plan of a machine.

    Attributes:
        overall: What the whole is and how it meets the task.
        assembly: How its sub-structures come together; "" if the plan does not say.
        motion_control: What moves it and how; "" if the plan does not say.
        sub_structures: Its parts, in building order.
    """

    overall: str
    assembly: str
    motion_control: str
    sub_structures: Sequence[SubStructure]

    @property
    def text(self) -> str:
        """The plan's text about the whole machine."""
        further = (("Assembly", self.assembly), ("Motion control", self.motion_control))
        return "\n".join([self.overall, *(f"{name}: {text}" for name, text in further if text)])


def read_plan(text: str) -> Plan:
    """Find the plan in a reply; what stands around it is ignored.

    Raises:
        PlanError: Something of its form is missing.
    """
    body = _last(text, "building_plan")
    if body is None:
        raise PlanError("there is no <building_plan> … </building_plan>")
    blocks = _all(body, "sub_structure") or _numbered(body)
    if not blocks:
        raise PlanError("there is no <sub_structure> … </sub_structure> in it")
    overall = _last(body, "overall_structure")
    if overall is None:
        raise PlanError("there is no <overall_structure> … </overall_structure> in it")
    whole = _outside(body, blocks)
    parts = []
    for number, block in enumerate(blocks, start=1):
        name = _last(block, "name")
        if not name:
            raise PlanError(f"sub-structure {number} has no <name>")
        texts = [(part, _last(block, part)) for part in PARTS]
        lines = [f"- {part.replace('_', ' ')}: {text}" for part, text in texts if text]
        if not lines:
            raise PlanError(f"sub-structure {name!r} says nothing but its name")
        parts.append(SubStructure(name=name, text="\n".join(lines)))
    names = Counter(sub_structure.name for sub_structure in parts)
    twice = sorted(name for name, times in names.items() if times > 1)
    if twice:
        raise PlanError(f"the name {twice[0]!r} stands for several sub-structures")
    return Plan(
        overall=_without_tags(overall),
        assembly=_last(whole, "assembly") or "",
        motion_control=_last(whole, "motion_control") or "",
        sub_structures=tuple(parts),
    )


def _numbered(body: str) -> list[str]:
    """Return the parts whose tags carry numbers, as in the published form."""
    parts: list[str] = []
    while blocks := _all(body, f"sub_structure_{len(parts) + 1}"):
        parts.append(blocks[-1])
    return parts


def _outside(body: str, blocks: Sequence[str]) -> str:
    """Return the plan without what its parts say."""
    for block in blocks:
        body = body.replace(block, "")
    return body


def _without_tags(overall: str) -> str:
    """Return the overall structure; in the published form it has parts of its own."""
    inner = [_last(overall, part) for part in ("description", "functionality")]
    description = "\n".join(text for text in inner if text)
    return description or overall


def _last(text: str, tag: str) -> str | None:
    texts = _all(text, tag)
    return texts[-1].strip() if texts else None


def _all(text: str, tag: str) -> list[str]:
    """Return the texts between a tag's openings and their next ends.

    Not a regular expression: openings without an end would take it the square of their number.
    """
    opening, ending = f"<{tag}>", f"</{tag}>"
    texts, place = [], 0
    while (start := text.find(opening, place)) >= 0:
        start += len(opening)
        end = text.find(ending, start)
        if end < 0:
            break
        texts.append(text[start:end])
        place = end + len(ending)
    return texts
