"""Pages, pictures and links of the documentation site that are generated from code.

They are not files of the repository. Documents mention them in phrases that read well without the
site, which become links and pictures. Links to files outside the site become the files' names.
"""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path
from typing import Any

from docs_modules import module_guide
from mkdocs.structure.files import File

from buildarena_api.contract import operations_page
from buildarena_geometry import Machine
from buildarena_geometry.export import View, machine_svg

LOG = logging.getLogger("mkdocs.hooks.generated")
ROOT = Path(__file__).parents[1]
TESTS = str(ROOT / "tests")
PAGES = {
    "the module guide": "modules.md",
    "what a model sees": "what-a-model-sees.md",
    "the API's page": "api.md",
}
"""Pages by their phrases in documents, which end with (`make docs`)."""
CALLED = re.compile(rf"({'|'.join(PAGES)}) \(`make docs`\)", re.IGNORECASE)
PICTURE = re.compile(r"^\*Picture \(`make docs`\): (.+)\.\*$", re.MULTILINE)
OUTSIDE = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+[^)\s]+)\)")
PICTURES = {
    "World and block frames": "geometry/frames.svg",
    "Free faces of three blocks": "geometry/faces.svg",
    "A cannon on the east face and a torch on the south face": "geometry/pointing.svg",
    "A car with four wheels": "geometry/first-machine.svg",
}
"""Paths of pictures in the documentation, by their captions."""


def on_files(files: Any, *, config: Any) -> Any:
    """Add the generated files; mkdocs calls it with the files that it found."""
    generated = {**module_guide(), **pictures(), "what-a-model-sees.md": _what_a_model_sees()}
    generated["api.md"] = operations_page()
    for path, text in generated.items():
        files.append(File.generated(config, path, content=text))
    return files


def _what_a_model_sees() -> str:
    """Return the page, whose sessions are played by the tests' support package."""
    if TESTS not in sys.path:
        sys.path.insert(0, TESTS)
    from support.documents.what_a_model_sees import page

    return page()


def on_page_markdown(markdown: str, *, page: Any, **_: object) -> str:
    """Replace phrases and links of a page; mkdocs calls it with each page."""

    def show(caption: re.Match[str]) -> str:
        if caption[1] not in PICTURES:
            LOG.warning("%s shows %r, which is not drawn", page.file.src_uri, caption[1])
        return f"![{caption[1]}]({PICTURES.get(caption[1], '')})"

    def replace_link(link: re.Match[str]) -> str:
        target = (folder / link[2].partition("#")[0]).resolve()
        if target.is_relative_to(ROOT / "docs"):
            return link[0]
        if not target.exists():
            LOG.warning("%s links to %s, which does not exist", page.file.src_uri, link[2])
        return f"{link[1]} (`{target.relative_to(ROOT)}`)"

    folder = (ROOT / "docs" / page.file.src_uri).parent
    linked = CALLED.sub(lambda name: f"[{name[1]}]({PAGES[name[1].lower()]})", markdown)
    return OUTSIDE.sub(replace_link, PICTURE.sub(show, linked))


def build(*parts: tuple[str, str, str]) -> Machine:
    """Build a machine of a starting block and (base, face, module) parts."""
    machine = Machine()
    machine.act("start")
    for base, face, module in parts:
        arguments = {"base_block": base, "face": face, "new_block": module}
        outcome = machine.act("attach_block_to", arguments)
        if not outcome.ok:
            raise SystemExit(outcome.text)
    return machine


def pictures() -> dict[str, str]:
    """Draw the guide's pictures, by their paths in the documentation."""
    block, wheel = "Small Wooden Block", "Powered Wheel"
    car = build(
        ("1", "E", block),
        ("2", "E", block),
        ("1", "A", wheel),
        ("1", "B", wheel),
        ("3", "A", wheel),
        ("3", "B", wheel),
    )
    spread = build(("1", "A", block), ("2", "E", wheel))
    engine = build(("1", "A", "Water Cannon"), ("1", "F", "Torch"))
    return {
        "geometry/frames.svg": machine_svg(
            build(("1", "A", block)), View(scale=110, frames=("1", "2"), compass=True)
        ),
        "geometry/faces.svg": machine_svg(spread, View(scale=110, face_labels=("1", "2", "3"))),
        "geometry/pointing.svg": machine_svg(engine, View(scale=80, ids=True)),
        "geometry/first-machine.svg": machine_svg(car, View(ids=True)),
    }
