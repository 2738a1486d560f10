"""What is known about a module besides its shape and its use, and from where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from buildarena_geometry.reading import Fields

CONFIDENCES = ("known", "community", "chosen", "unknown")
FACT_FIELDS = ("brief", "categories", "simulated", "default_keys", "sources")


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What is known about a module besides its shape and its use.

    Attributes:
        brief: what models read about it in a list; "" for the first sentence of its description.
        categories: the groups it is looked up in; the first one is its own.
        simulated: whether both engines have its physics; without, it can be built and not tried.
        default_keys: the keys the game binds to its actions unless told otherwise, by action.
        sources: where a figure comes from, by its name: a confidence ("known", "community",
            "chosen" or "unknown"), or that and the source or reason after a colon.
    """

    brief: str = ""
    categories: tuple[str, ...] = ()
    simulated: bool = True
    default_keys: tuple[tuple[str, str], ...] = ()
    sources: tuple[tuple[str, str], ...] = ()


NO_FACTS = Facts()


def read_facts(fields: Fields, actions: tuple[str, ...]) -> Facts:
    """The facts of an entry of a module file.

    Args:
        fields: the entry's fields.
        actions: what the module's keys can make it do.

    Raises:
        CatalogueError: a field breaks the format.
    """
    return Facts(
        brief=fields["brief"].text(longest=100) if "brief" in fields else "",
        categories=tuple(name.text(longest=60) for name in fields.items("categories")),
        simulated=fields["simulated"].truth() if "simulated" in fields else True,
        default_keys=tuple(_keys(fields, actions)),
        sources=tuple(_sources(fields).items()),
    )


def _keys(fields: Fields, actions: tuple[str, ...]) -> list[tuple[str, str]]:
    if "default_keys" not in fields:
        return []
    found = []
    for action, key in fields["default_keys"].entries():
        if action not in actions:
            key.fail(f"keys of the actions {', '.join(actions) or 'none'} only")
        found.append((action, key.text(longest=60)))
    return found


def _sources(fields: Fields) -> Mapping[str, str]:
    if "sources" not in fields:
        return {}
    found = {}
    for figure, source in fields["sources"].entries():
        text = source.text()
        if text.partition(":")[0] not in CONFIDENCES:
            source.fail(f"a text that begins with one of {', '.join(CONFIDENCES)}")
        found[figure] = text
    return found
