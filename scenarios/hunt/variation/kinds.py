"""Kinds of tasks: what sort of machine each asks for, in whichever category boards list it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from buildarena_benchmark import builtin_tasks

KINDS: Final = (
    *("support", "transport", "lift", "mechanisms", "flight", "control"),
    *("throwing", "driving", "delivering"),
)

_FAMILIES: Final = {
    "budget": "support",
    "repair": "transport",
    "identify": "flight",
    "throw": "throwing",
    "deliver": "delivering",
    "drive": "driving",
    "fetch": "mechanisms",
}
"""What sort of machine a family asks for, where its name does not say so."""


ALIKE: Final[Mapping[str, str]] = MappingProxyType(
    {"driving": "transport", "delivering": "transport"}
)
"""Another kind whose machines are worth a try, too."""


def kind_of(task: str) -> str:
    """The kind of a task: control where programs sense; otherwise by its name or its family."""
    if builtin_tasks()[task].scenario.senses is not None:
        return "control"
    kind = task.rpartition("-")[0]
    return _FAMILIES.get(kind, kind)
