"""Building plans, parsed leniently from the planner's answer because models write loose XML."""

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
    """A text without a plan; the message for the model names the missing part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SubStructure:
    """A separately built part of the machine.

    Attributes:
        name: Unique in its plan.
        text: Text of the plan about the part.
    """

    name: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Plan of a machine.

    Attributes:
        text: Text about the complete machine.
        sub_structures: Parts in building order.
    """

    text: str
    sub_structures: Sequence[SubStructure]


def parse_plan(text: str) -> Plan:
    """Parse the plan in a reply, ignoring the text around it.

    Raises:
        PlanError: A required element is missing.
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
    for block in blocks:
        body = body.replace(block, "")
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
    sections = (("Assembly", "assembly"), ("Motion control", "motion_control"))
    about = [f"{title}: {said}" for title, tag in sections if (said := _last(body, tag))]
    return Plan(text="\n".join([_without_tags(overall), *about]), sub_structures=tuple(parts))


def _numbered(body: str) -> list[str]:
    """Return the parts whose tags carry numbers, as in the published form."""
    parts: list[str] = []
    while blocks := _all(body, f"sub_structure_{len(parts) + 1}"):
        parts.append(blocks[-1])
    return parts


def _without_tags(overall: str) -> str:
    """Return the overall structure, which is divided into parts in the published form."""
    inner = [_last(overall, part) for part in ("description", "functionality")]
    return "\n".join(text for text in inner if text) or overall


def _last(text: str, tag: str) -> str | None:
    texts = _all(text, tag)
    return texts[-1].strip() if texts else None


def _all(text: str, tag: str) -> list[str]:
    """Return the texts between a tag's openings and their next ends.

    Not a regular expression, which would take quadratic time for openings without an end.
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
