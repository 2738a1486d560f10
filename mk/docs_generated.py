"""Pages, pictures and links of the documentation site that are generated from code.

They are not files of the repository. Documents mention them in phrases that read well without the
site, which become links and pictures. Links to files outside the site become the files' names.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

from docs_modules import module_guide
from mkdocs.structure.files import File
from support.documents.what_a_model_sees import page as what_a_model_sees

from buildarena_api.contract import operations_page
from buildarena_geometry import Machine
from buildarena_geometry.export import View, machine_svg

LOG = logging.getLogger("mkdocs.hooks.generated")
ROOT = Path(__file__).parents[1]
PAGES = {
    "the module guide": "modules.md",
    "what a model sees": "what-a-model-sees.md",
    "the API's page": "api.md",
}
"""Pages by their phrases in documents, which end with (`make docs`)."""
CALLED = re.compile(rf"({'|'.join(PAGES)}) \(`make docs`\)", re.IGNORECASE)
PICTURE = re.compile(r"^\*Picture \(`make docs`\): (.+)\.\*$", re.MULTILINE)
OUTSIDE = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+[^)\s]+)\)")


def on_files(files: Any, *, config: Any) -> Any:
    """Add the generated files; mkdocs calls it with the files that it found."""
    pages = {"what-a-model-sees.md": what_a_model_sees(), "api.md": operations_page()}
    drawn = {picture_path(caption): picture for caption, picture in pictures().items()}
    for path, text in {**module_guide(), **drawn, **pages}.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: object) -> str:
    """Replace phrases and links of a page; mkdocs calls it with each page."""

    def replace_link(link: re.Match[str]) -> str:
        target = (folder / link[2].partition("#")[0]).resolve()
        if target.is_relative_to(ROOT / "docs"):
            return link[0]
        if not target.exists():
            LOG.warning("%s links to %s, which does not exist", page.file.src_uri, link[2])
        return f"{link[1]} (`{target.relative_to(ROOT)}`)"

    folder = (ROOT / "docs" / page.file.src_uri).parent
    linked = CALLED.sub(lambda name: f"[{name[1]}]({PAGES[name[1].lower()]})", markdown)
    # The site's own check of links finds a caption without a picture.
    shown = PICTURE.sub(lambda name: f"![{name[1]}]({picture_path(name[1])})", linked)
    return OUTSIDE.sub(replace_link, shown)


def picture_path(caption: str) -> str:
    """Return the path of a picture in the documentation."""
    return f"images/{caption.lower().replace(' ', '-')}.svg"


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
    """Draw the guide's pictures, by their captions."""
    block, wheel = "Small Wooden Block", "Powered Wheel"
    wheels = [(base, face, wheel) for base in "13" for face in "AB"]
    car = build(("1", "E", block), ("2", "E", block), *wheels)
    spread = build(("1", "A", block), ("2", "E", wheel))
    engine = build(("1", "A", "Water Cannon"), ("1", "F", "Torch"))
    return {
        "World and block frames": machine_svg(
            build(("1", "A", block)), View(scale=110, frames=("1", "2"), compass=True)
        ),
        "Free faces of three blocks": machine_svg(
            spread, View(scale=110, face_labels=("1", "2", "3"))
        ),
        "A cannon on the east face and a torch on the south face": machine_svg(
            engine, View(scale=80, ids=True)
        ),
        "A car with four wheels": machine_svg(car, View(ids=True)),
    }
