"""Draws the pictures of the geometry guide: `make geometry-pictures`."""

from __future__ import annotations

import sys
from pathlib import Path

from buildarena_geometry import Machine
from buildarena_geometry.export import View, machine_svg


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
    """The guide's pictures by file name."""
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
        "frames.svg": machine_svg(
            build(("1", "A", block)), View(scale=110, frames=("1", "2"), compass=True)
        ),
        "faces.svg": machine_svg(spread, View(scale=110, face_labels=("1", "2", "3"))),
        "pointing.svg": machine_svg(engine, View(scale=80, ids=True)),
        "first-machine.svg": machine_svg(car, View(ids=True)),
    }


def main() -> None:
    """Writes the pictures to the folder named on the command line."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pictures().items():
        (folder / name).write_text(text)


if __name__ == "__main__":
    main()
