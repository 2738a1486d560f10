"""A small car: its feedback for models is printed, and its files and picture are saved.

Run it with a folder to write to: `python examples/geometry/first_machine.py /tmp/car`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from buildarena_geometry import Machine
from buildarena_geometry.export import View, machine_glb, machine_svg


def build_car() -> Machine:
    """Build a chassis of three blocks on four wheels, driven by the arrow keys."""
    car = Machine()
    chassis = (
        ("1", "E", "Small Wooden Block"),
        ("2", "E", "Small Wooden Block"),
        ("1", "A", "Powered Wheel"),
        ("1", "B", "Powered Wheel"),
        ("3", "A", "Powered Wheel"),
        ("3", "B", "Powered Wheel"),
    )
    print(car.act("start", {"note": "front axle"}).text)
    for base, face, module in chassis:
        arguments = {"base_block": base, "face": face, "new_block": module}
        print(car.act("attach_block_to", arguments).text)
    for wheel in ("5", "7"):
        # A wheel on the west side would roll south: its spin is flipped.
        print(car.act("flip_spin", {"block_id": wheel}).text)
    for wheel in ("4", "5", "6", "7"):
        binding = {"block_id": wheel, "action": "spinning_forward", "new_key": "UpArrow"}
        car.act("change_control_key", binding)
    car.act("add_control_sequence", {"time": 0, "key": "UpArrow", "hold_for": 10})
    return car


def main() -> None:
    """Build the car and write car.json, car.glb and car.svg."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    car = build_car()
    print(car.act("get_machine_summary").text)
    (folder / "car.json").write_text(json.dumps(car.to_document(), indent=1))
    (folder / "car.glb").write_bytes(machine_glb(car))
    (folder / "car.svg").write_text(machine_svg(car, View(ids=True)))


if __name__ == "__main__":
    main()
