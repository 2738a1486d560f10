"""The guide of all modules is what the module files say."""

import importlib.util
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from buildarena_geometry import module_set
from buildarena_geometry.export import View, module_svg

ROOT = Path(__file__).parents[3]
MODULES = [module for module in module_set("all").values() if module.kind != "cargo"]


@pytest.fixture(scope="module")
def made():
    place = ROOT / "examples" / "geometry" / "describe_modules.py"
    spec = importlib.util.spec_from_file_location("describe_modules", place)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script.files()


def test_the_guide_is_current(made):
    old = [
        str(path)
        for path, text in made.items()
        if not (ROOT / "docs" / path).is_file() or (ROOT / "docs" / path).read_text() != text
    ]
    assert not old, "make module-guide writes them again"
    pictures = {
        file.relative_to(ROOT / "docs") for file in (ROOT / "docs/images/modules").iterdir()
    }
    assert pictures <= made.keys()


def test_every_type_has_a_section_and_a_picture(made):
    guide = made[Path("modules.md")]
    for module in MODULES:
        assert f"\n## {module.name}\n" in guide
    assert len(made) == len(MODULES) + 1


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_a_picture_shows_the_body_and_its_faces(module):
    root = ET.fromstring(module_svg(module))
    kinds = [element.tag.rpartition("}")[2] for element in root.iter()]
    shapes = kinds.count("line") if module.kind == "connector" else kinds.count("polygon")
    assert shapes
    written = {element.text for element in root.iter() if element.tag.endswith("text")}
    upward = {face.label for face in module.faces if face.normal[2] > 0.5}
    assert upward <= written


def test_large_modules_are_drawn_as_large_as_small_ones():
    barrel, block = module_set("all")["Big Barrel"], module_set("all")["Small Wooden Block"]
    assert width(module_svg(barrel)) < 3 * width(module_svg(block))
    assert width(module_svg(block, View(scale=160))) > 1.5 * width(module_svg(block))


def width(svg):
    return float(ET.fromstring(svg).get("width"))
