"""How much room indicators leave above good machines; run by `make bench-ceilings`.

For the paper's tasks and those of throwing and courses: the greatest indicator that there is, the
expert's, and those of three designs that somebody would try first, on MuJoCo. A table in Markdown
goes to standard error, for docs/expert.md.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import tell
from support.machines.expert_calls import built
from support.machines.families import car, rocket, rocket_assembly
from support.machines.people import bridges, rockets, vehicles

from buildarena_benchmark import builtin_tasks, references, score
from buildarena_geometry import Machine, catalogue_of
from buildarena_simulation import MachineNotSimulable, simulate
from buildarena_worker.builtin.designs import DESIGNS
from buildarena_worker.builtin.designs.design import Design
from buildarena_worker.builtin.designs.drafting import EAST, WEST
from buildarena_worker.builtin.designs.throwers import Shape, plain_catapult

Build = Callable[[], Machine]
ENGINE: Final = "mujoco"
_STRAIGHT: Final = (("UpArrow", 0.5, 20.0),)
_SHUTTLE: Final = (("UpArrow", 3.0, 1.4), ("DownArrow", 6.5, 1.4))


def _machine(design: Callable[[], Design]) -> Machine:
    return built(design(), Machine(catalogue=catalogue_of("all")))


def _bridges(gap: int) -> dict[str, Build]:
    return {
        "beam": partial(bridges.beam, gap),
        "king-post": partial(bridges.king_post, gap),
        "arch": partial(bridges.arch, gap, rise=2),
    }


def _cars(drive: Any, tray: tuple[int, int] | None = None) -> dict[str, Build]:
    make = partial(vehicles.car, length=7, track=2, drive=drive, tray=tray)
    return {f"car of {2 * axles} wheels": partial(make, axles) for axles in (2, 3, 4)}


def _couriers() -> dict[str, Build]:
    return {
        "car of 4 wheels": partial(car, 5, 1, drive=_STRAIGHT),
        "wide car": partial(car, 5, 2, drive=_STRAIGHT),
        "car with a deck": partial(car, 5, 2, deck_half=(2, 2), drive=_STRAIGHT),
    }


def _catapults() -> dict[str, Build]:
    shapes = {
        "3 springs": Shape(springs=3),
        "5 springs, flat cup": Shape(springs=5, cup_deg=0),
        "7 springs, short arm": Shape(springs=7, arm=5, lean_deg=47),
    }
    designs = {name: partial(plain_catapult, shape) for name, shape in shapes.items()}
    return {name: partial(_machine, design) for name, design in designs.items()}


def _cranes() -> dict[str, Build]:
    names = ("mechanisms-4", "mechanisms-3", "place-2")
    return {f"the arm of {name}": partial(_machine, partial(DESIGNS[name], 0)) for name in names}


FIRST_TRIES: Final[Mapping[str, Mapping[str, Build]]] = {
    "support-1": _bridges(5),
    "support-2": _bridges(10),
    "support-3": _bridges(20),
    "support-4": _bridges(30),
    "support-5": _bridges(45),
    "support-6": _bridges(5),
    "support-7": _bridges(10),
    "transport-1": _cars((("RightArrow", 1.0, 0.25), ("UpArrow", 1.6, 20.0))),
    "transport-2": _cars((("UpArrow", 3.0, 6.0),), (2, 2)),
    "transport-3": _cars(_SHUTTLE, (2, 4)),
    "lift-1": {
        "2 cannons": partial(rocket, (EAST, WEST), heated=False),
        "4 cannons": partial(rocket, heated=False),
        "4 heated cannons": rocket,
    },
    "lift-2": {f"ring of {count} cannons": partial(rockets.ring, count) for count in (3, 4, 8)},
    "lift-3": {
        "frame on 2 cannons": partial(rocket_assembly, (EAST, WEST)),
        "frame on 4 cold ones": partial(rocket_assembly, heated=False),
        "frame on 4 cannons": rocket_assembly,
    },
    **{f"throw-{level}": _catapults() for level in (1, 2, 3, 4, 5)},
    **{f"deliver-{level}": _couriers() for level in (1, 2, 3)},
    **{f"drive-{level}": _couriers() for level in (1, 2, 3, 4)},
    "fetch-1": _cranes(),
}
"""By task: three designs by name."""


def figure(task: str, build: Build) -> float | str:
    """The indicator of a design's exact trial, or why there is none."""
    try:
        machine = build()
        trajectory = simulate(machine, builtin_tasks()[task].scenario, ENGINE)
    except (MachineNotSimulable, ValueError) as error:
        return str(error).partition(".")[0]
    result = score(builtin_tasks()[task], machine, trajectory)
    return round(result.indicator, 4)


def row(task: str) -> dict[str, Any]:
    """A task's figures."""
    return {
        "task": task,
        "ceiling": builtin_tasks()[task].ceiling,
        "expert": references()[task],
        "first_tries": {name: figure(task, build) for name, build in FIRST_TRIES[task].items()},
    }


def in_markdown(rows: list[dict[str, Any]]) -> str:
    """The table of docs/expert.md."""
    lines = ["| task | greatest | expert | first tries |", "|---|---|---|---|"]
    for each in rows:
        most = "none" if each["ceiling"] is None else f"{each['ceiling']:,g}"
        tries = ", ".join(f"{name} {value}" for name, value in each["first_tries"].items())
        lines.append(f"| {each['task']} | {most} | {each['expert']:,g} | {tries} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Prints the table, and its figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    rows = [row(task) for task in FIRST_TRIES]
    sys.stderr.write(in_markdown(rows))
    tell(rows, parser.parse_args().json)


if __name__ == "__main__":
    main()
