"""The documentation site's guide of all modules, with their pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from importlib import resources
from typing import Any

from buildarena_geometry import Module, module_set
from buildarena_geometry.export import module_svg
from buildarena_geometry.feedback.words import plain, point

FILES = ("modules.yaml", "extended.yaml")
PICTURES = "images/modules"
GUIDE = "modules.md"
NOT_PHYSICS = {
    *(
        "name",
        "brief",
        "kind",
        "categories",
        "simulated",
        "mass",
        "cost",
        "size",
        "center",
        "faces",
    ),
    *("colliders", "body", "pointing", "landmarks", "actions", "default_keys", "spin", "sources"),
    *("root_offset", "overlaps_base", "description", "besiege"),
}
"""Fields of a module's entry that are elsewhere in its section, or describe only its shape."""
_SURE = (
    ("known", ("known", "the paper")),
    ("community", ("community", "modding notes")),
    ("chosen", ("chosen", "fitted")),
    ("unknown", ("unknown", "not public")),
)
"""Phrases in the text of an origin that state its certainty."""
HEAD = """# All modules

What machines can be made of, from the module files; `make docs` writes this page. The set `basic`
has the paper's modules, `workshop` also all other simulated types except those that tasks must
name (`by_name`), `all` every type that can be built; a task names the set it offers. Lengths are
edges of a small block, masses the game's, forces the weights of a mass (mass·g), angles degrees.
Pictures show a module on its root point: x red, y green, z blue, away from the
face it sits on; letters name the faces.

Each figure has its origin: **known** was read out of the game or measured by its
publishers, **community** was reported or measured by players, **chosen** is ours with its reason,
**unknown** is not public.
"""


def module_guide() -> dict[str, str]:
    """Return the guide and its pictures, by their paths in the documentation."""
    modules = [module for module in module_set("all").values() if module.kind != "cargo"]
    entries = _entries()
    files = {_picture(module): module_svg(module) for module in modules}
    sections = [_contents(modules)]
    sections += ["\n".join(_section(module, entries[module.name])) for module in modules]
    files[GUIDE] = "\n\n".join([HEAD.strip(), *sections]) + "\n"
    return files


def _entries() -> dict[str, Mapping[str, Any]]:
    folder = resources.files("buildarena_geometry.modules")
    return {
        entry["name"]: entry
        for file in FILES
        for entry in json.loads(folder.joinpath(file).read_text(encoding="utf-8"))["modules"]
    }


def _slug(module: Module) -> str:
    return module.name.lower().replace(" ", "-")


def _picture(module: Module) -> str:
    return f"{PICTURES}/{_slug(module)}.svg"


def _contents(modules: list[Module]) -> str:
    rows = [
        "| category | modules; those in *italics* can be built and are not simulated |",
        "|---|---|",
    ]
    by_category: dict[str, list[str]] = {}
    for module in modules:
        link = f"[{module.name}](#{_slug(module)})"
        shown = link if module.simulated else f"*{link}*"
        by_category.setdefault(module.categories[0], []).append(shown)
    rows += [f"| {category} | {', '.join(links)} |" for category, links in by_category.items()]
    return "\n".join(rows)


def _section(module: Module, entry: Mapping[str, Any]) -> Iterator[str]:
    yield f"## {module.name}\n"
    yield f"![{module.name}]({_picture(module)})\n"
    yield f"{module.description}\n"
    yield "| | |"
    yield "|---|---|"
    for name, text in _facts(module, entry):
        yield f"| {name} | {text} |"
    sources = [*module.sources.items(), *_origins(entry)]
    if sources:
        yield "\n| figure | how sure | from, or why |"
        yield "|---|---|---|"
        for figure, source in sources:
            sure, _, reason = source.partition(":")
            yield f"| {figure} | {sure} | {reason.strip() or 'nothing public'} |"


def _facts(module: Module, entry: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    state = "simulated on both engines" if module.simulated else "can be built, not simulated"
    yield "use", f"{module.kind}; {', '.join(module.categories)}; {state}"
    size = "" if module.size is None else f", size {' x '.join(map(plain, module.size))}"
    figures = f"mass {plain(module.mass)}, cost {module.cost}{size}"
    yield "figures", f"{figures}, number {module.besiege_id} in Besiege"
    if module.faces:
        faces = [
            f"{face.label} {point(face.center)} facing {point(face.normal)}"
            for face in module.faces
        ]
        yield "faces", "; ".join(faces)
    elif module.kind != "connector":
        yield "faces", "none"
    if module.pointing is not None:
        yield "points", point(module.pointing)
    if module.actions:
        keys = module.default_keys
        yield (
            "controls",
            ", ".join(
                f"`{action}`" + (f" (the game's key: {keys[action]})" if action in keys else "")
                for action in module.actions
            ),
        )
    if module.spin_sense is not None:
        yield "spin", f"{module.spin_sense} as it is, seen from outside; can be flipped"
    if module.overlaps_base:
        yield "shape", "reaches into the block it sits on by design"
    for name, value in entry.items():
        if name not in NOT_PHYSICS and value not in (None, [], {}):
            yield name, _format(value)


def _format(value: Any) -> str:
    """Format a value of the module file for a table's cell."""
    if isinstance(value, Mapping):
        parts = (f"{name} {_format(held)}" for name, held in value.items() if name != "origin")
        return "; ".join(parts)
    if isinstance(value, list):
        return "[" + ", ".join(map(_format, value)) + "]"
    return json.dumps(value) if isinstance(value, bool) else str(value)


def _origins(entry: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the origins that the physics states for its figures."""
    for name, value in entry.items():
        if name in NOT_PHYSICS or not isinstance(value, Mapping):
            continue
        for where, held in ((name, value), (f"{name}, drive", value.get("drive"))):
            if isinstance(held, Mapping) and held.get("origin"):
                yield where, _confidence(str(held["origin"]))


def _confidence(origin: str) -> str:
    """Return an origin's text with its certainty first, if it comes later or in other words."""
    if origin.partition(":")[0] in dict(_SURE):
        return origin
    sure = dict.fromkeys(word for word, signs in _SURE if any(sign in origin for sign in signs))
    return f"{', '.join(sure) or 'chosen'}: {origin}"
