"""Of the site of documents: the pictures of the geometry guide."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_geometry.export import View, machine_svg

PICTURES = {
    "World and block frames": "geometry/frames.svg",
    "Free faces of three blocks": "geometry/faces.svg",
    "A cannon on the east face and a torch on the south face": "geometry/pointing.svg",
    "A car with four wheels": "geometry/first-machine.svg",
}
"""The pictures' paths among the documents, by what they show."""


def build(*parts: tuple[str, str, str]) -> Machine:
    """A machine of a starting block and (base, face, module) parts."""
    machine = Machine()
    machine.act("start")
    for base, face, module in parts:
        arguments = {"base_block": base, "face": face, "new_block": module}
        outcome = machine.act("attach_block_to", arguments)
        if not outcome.ok:
            raise SystemExit(outcome.text)
    return machine


def pictures() -> dict[str, str]:
    """The guide's pictures by their paths among the documents."""
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
