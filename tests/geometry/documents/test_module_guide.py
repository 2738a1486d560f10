"""The pictures of modules, of which `make docs` makes the module guide."""

import xml.etree.ElementTree as ET

from buildarena_geometry import Module, module_set
from buildarena_geometry.export import View, module_svg

MODULES = [module for module in module_set("all").values() if module.kind != "cargo"]


def test_pictures_show_the_body_and_its_faces():
    wrong = {module.name: faults for module in MODULES if (faults := faults_of(module))}
    assert not wrong


def test_large_modules_are_drawn_as_large_as_small_ones():
    barrel, block = module_set("all")["Big Barrel"], module_set("all")["Small Wooden Block"]
    assert width(module_svg(barrel)) < 3 * width(module_svg(block))
    assert width(module_svg(block, View(scale=160))) > 1.5 * width(module_svg(block))


def faults_of(module: Module) -> list[str]:
    """What a module's picture lacks."""
    elements = list(ET.fromstring(module_svg(module)).iter())
    kinds = {element.tag.rpartition("}")[2] for element in elements}
    body = "line" if module.kind == "connector" else "polygon"
    written = {element.text for element in elements if element.tag.endswith("text")}
    upward = {face.label for face in module.faces if face.normal[2] > 0.5}
    return [name for name in (body,) if name not in kinds] + sorted(upward - written)


def width(svg):
    return float(ET.fromstring(svg).get("width"))
