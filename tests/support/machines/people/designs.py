"""Sixty honest designs by name, and what each engine makes of them.

tests/data/people.json keeps the verdicts; `python -m support.machines.people.designs` in tests/
writes it again.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from support.machines.people import bridges, flyers, rockets, vehicles, winches

from buildarena_benchmark import broken_constraint, builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, simulate

DATA: Final = Path(__file__).parents[3] / "data" / "people.json"

_TURN: Final = (("RightArrow", 1.0, 0.25), ("UpArrow", 1.6, 3.0))
_CARRY: Final = (("UpArrow", 3.0, 4.0),)
_carrier = partial(vehicles.car, length=7, track=2, tray=(2, 2), drive=_CARRY)
_car = partial(vehicles.car, length=7, drive=_TURN)


Build = Callable[..., Machine]


@dataclass(frozen=True, slots=True)
class HonestDesign:
    """A design as people build it.

    Attributes:
        task: What it is for.
        build: Builds it.
    """

    task: str
    build: Callable[[], Machine]


def _listed() -> dict[str, HonestDesign]:
    found: dict[str, HonestDesign] = {}

    def add(
        name: str, task: str, build: Callable[..., Machine], *values: Any, **named: Any
    ) -> None:
        found[name] = HonestDesign(task, partial(build, *values, **named))

    add("beam over 5", "support-1", bridges.beam, 5)
    add("arch over 5", "support-1", bridges.arch, 5, rise=1)
    add("steep arch over 5", "support-1", bridges.arch, 5, rise=2, step=1)
    add("king-post over 5", "support-1", bridges.king_post, 5)
    add("queen-post over 5", "support-1", bridges.queen_post, 5, height=2)
    add("suspended deck over 5", "support-1", bridges.hung, 5, hangers=1)
    add("double beam over 10", "support-2", bridges.beam, 10, depth=2)
    add("flat arch over 10", "support-2", bridges.arch, 10, rise=1, step=3)
    add("arch over 10", "support-2", bridges.arch, 10, rise=2)
    add("wide arch over 10", "support-2", bridges.arch, 10, rise=3, step=1, width=3)
    add("king-post over 10", "support-2", bridges.king_post, 10)
    add("queen-post over 10", "support-2", bridges.queen_post, 10)
    for kind in ("pratt", "howe", "warren", "cross"):
        add(f"{kind} truss over 10", "support-2", bridges.truss, 10, kind=kind)
    add("suspended deck over 10", "support-2", bridges.hung, 10)
    add("box girder over 10", "support-2", bridges.box_girder, 10)
    add("beam over 20", "support-3", bridges.beam, 20, overlap=5)
    add("double beam over 20", "support-3", bridges.beam, 20, depth=2, overlap=6)
    add("arch over 20", "support-3", bridges.arch, 20, rise=4)
    add("wide arch over 20", "support-3", bridges.arch, 20, rise=5, width=3)
    add("king-post over 20", "support-3", bridges.king_post, 20, height=4)
    add("queen-post over 20", "support-3", bridges.queen_post, 20, height=4)
    for kind in ("pratt", "warren"):
        add(f"{kind} truss over 20", "support-3", bridges.truss, 20, kind=kind)
    add("suspended deck over 20", "support-3", bridges.hung, 20, height=6, hangers=4)
    add("box girder over 20", "support-3", bridges.box_girder, 20)
    for axles in (2, 3, 4):
        add(f"car of {2 * axles} wheels", "transport-1", _car, axles)
    for axles in (3, 4):
        add(f"car of {2 * axles - 1} wheels", "transport-1", _car, axles, trike=True)
    add("cart of 2 wheels", "transport-2", _carrier, 1)
    add("carrier of 3 wheels", "transport-2", _carrier, 2, trike=True)
    for axles in (2, 3, 4):
        add(f"carrier of {2 * axles} wheels", "transport-2", _carrier, axles)
    for cannons in range(3, 13):
        add(f"ring of {cannons} cannons", "lift-2", rockets.ring, cannons)
    add("glider", "flight-2", flyers.glider)
    add("glider at 5 degrees", "flight-2", flyers.glider, incidence=5.0)
    add("glider at 8 degrees", "flight-2", flyers.glider, incidence=8.0)
    add("glider with a long nose", "flight-2", flyers.glider, nose=6)
    add("long glider at 8 degrees", "flight-2", flyers.glider, nose=6, boom=8, incidence=8.0)
    add("canard", "flight-2", flyers.canard, fore=10.0)
    add("short canard", "flight-2", flyers.canard, fore=10.0, ahead=6)
    add("canard with a short tail", "flight-2", flyers.canard, fore=10.0, behind=1)
    add("winch", "mechanisms-3", winches.lever)
    add("winch of a short arm", "mechanisms-3", winches.lever, arm=5, lasts_s=0.95)
    add("winch of fewer weights", "mechanisms-3", winches.lever, weights=3)
    add("four balloons", "flight-1", flyers.balloons)
    add("two balloons", "flight-1", flyers.balloons, count=2)
    add("four balloons on long arms", "flight-1", flyers.balloons, arm=4)
    return found


HONEST: Final[Mapping[str, HonestDesign]] = MappingProxyType(_listed())


def verdict(name: str, engine: str) -> dict[str, Any]:
    """Success, indicator and flags of a design's trial.

    Raises:
        ValueError: It breaks one of its task's constraints.
    """
    design = HONEST[name]
    task, machine = builtin_tasks()[design.task], design.build()
    broken = broken_constraint(task, machine)
    if broken is not None:
        raise ValueError(f"{name}: {broken[1]}")
    result = score(task, machine, simulate(machine, task.scenario, engine))
    return {
        "success": result.success,
        "indicator": round(result.indicator, 2),
        "flags": list(result.flags),
    }


def kept() -> dict[str, dict[str, Any]]:
    """The verdicts in the file, by design and engine."""
    return dict(json.loads(DATA.read_text(encoding="utf-8")))


def _write() -> None:
    rows = []
    for name, design in HONEST.items():
        row = {"task": design.task, **{engine: verdict(name, engine) for engine in ENGINES}}
        rows.append(f"{json.dumps(name)}: {json.dumps(row)}")
        print(rows[-1], flush=True)  # noqa: T201 - a program
    DATA.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    _write()
