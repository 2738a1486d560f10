"""The documentation site's guide of all modules, with their pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from importlib import resources
from typing import Any

from buildarena_geometry import Module, module_set
from buildarena_geometry.export import module_svg
from buildarena_geometry.feedback.modules import module_text

FILES = ("modules.yaml", "extended.yaml")
CATALOGUE = module_set("all").with_data_sheets
MODULES = [module for module in CATALOGUE.values() if module.kind != "cargo"]
_SURE = {"known": "the paper", "community": "modding notes", "chosen": "fitted"}
"""Phrases in the text of an origin that state its certainty, besides the certainty itself."""
HEAD = """# All modules

What machines can be made of, as models read it. The set `basic` has the paper's modules,
`workshop` also all other simulated types except those that tasks must name (`by_name`), `all` every
type that can be built; a task names the set it offers. Lengths are edges of a small block, masses
the game's. Pictures show a module on its root point: x red, y green, z blue, away from the face it
sits on; letters name the faces.

Each figure has its origin: **known** was read out of the game or measured by its publishers,
**community** was reported or measured by players, **chosen** is ours with its reason, **unknown**
is not public.

| category | modules; those in *italics* can be built and are not simulated |
|---|---|"""


def module_guide() -> dict[str, str]:
    """Return the guide and its pictures, by their paths in the documentation."""
    folder = resources.files("buildarena_geometry.modules")
    entries = {
        entry["name"]: entry
        for file in FILES
        for entry in json.loads(folder.joinpath(file).read_text(encoding="utf-8"))["modules"]
    }
    sections = ["\n".join(_section(module, entries[module.name])) for module in MODULES]
    files = {_picture(module): module_svg(module) for module in MODULES}
    files["modules.md"] = "\n\n".join(["\n".join([HEAD, *_contents()]), *sections]) + "\n"
    return files


def _slug(module: Module) -> str:
    return module.name.lower().replace(" ", "-")


def _picture(module: Module) -> str:
    return f"images/modules/{_slug(module)}.svg"


def _contents() -> Iterator[str]:
    by_category: dict[str, list[str]] = {}
    for module in MODULES:
        link = f"[{module.name}](#{_slug(module)})"
        shown = link if module.simulated else f"*{link}*"
        by_category.setdefault(module.categories[0], []).append(shown)
    for category, links in by_category.items():
        yield f"| {category} | {', '.join(links)} |"


def _section(module: Module, entry: Mapping[str, Any]) -> Iterator[str]:
    state = "simulated on both engines" if module.simulated else "can be built, not simulated"
    yield f"## {module.name}\n"
    yield f"![{module.name}]({_picture(module)})\n"
    yield f"{module_text(module, CATALOGUE)}\n"
    game = f"cost {module.cost}, number {module.besiege.id} in Besiege"
    yield f"{module.kind}; {', '.join(module.categories)}; {state}; {game}"
    sources = [*module.sources.items(), *_origins(entry)]
    if sources:
        yield "\n| figure | how sure | from, or why |"
        yield "|---|---|---|"
        for figure, source in sources:
            sure, _, reason = source.partition(":")
            yield f"| {figure} | {sure} | {reason.strip() or 'nothing public'} |"


def _origins(entry: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the origins that the physics states for its figures."""
    for name, value in entry.items():
        inner = value if isinstance(value, Mapping) else {}
        for where, held in ((name, inner), (f"{name}, drive", inner.get("drive"))):
            if isinstance(held, Mapping) and held.get("origin"):
                yield where, _confidence(str(held["origin"]))


def _confidence(origin: str) -> str:
    """Return an origin's text with its certainty first, if it comes later or in other words."""
    if origin.partition(":")[0] in {*_SURE, "unknown"}:
        return origin
    sure = [word for word, sign in _SURE.items() if word in origin or sign in origin]
    if "unknown" in origin or "not public" in origin:
        sure.append("unknown")
    return f"{', '.join(sure) or 'chosen'}: {origin}"
