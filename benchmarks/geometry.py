"""Measures what the geometry library promises, on one core; prints medians and writes JSON.

Run it with `make bench NAME=geometry`. Exit code 1 says that a figure missed its bar.
"""

from __future__ import annotations

import argparse
import random
import statistics
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.figures import keep

from buildarena_geometry import Machine, module_set, replay

if TYPE_CHECKING:
    from collections.abc import Callable

BLOCK = "Small Wooden Block"
ROUNDS = 15
RESIDENT_PROGRAM = """
import re
from pathlib import Path
from buildarena_geometry import Machine
machine = Machine()
machine.act("start")
for index in range(199):
    base = str(index + 1)
    face = "A" if index == 0 else "E"
    arguments = {"base_block": base, "face": face, "new_block": "Small Wooden Block"}
    machine.act("attach_block_to", arguments)
assert len(machine.blocks) == 200
print(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A measured figure and its bar; `published` is the published library on the same work."""

    name: str
    value: float
    unit: str
    bar: float
    published: str

    @property
    def met(self) -> bool:
        """Whether it keeps below its bar."""
        return self.value <= self.bar


def attach(machine: Machine, base: str, face: str) -> bool:
    arguments = {"base_block": base, "face": face, "new_block": BLOCK}
    return machine.act("attach_block_to", arguments).ok


def lattice(size: int) -> Machine:
    """A machine of so many blocks without a refused action in its log."""
    rows = 10
    machine = Machine()
    machine.act("start")
    ends = ["1"]
    for _ in range(1, min(rows, size)):
        attach(machine, ends[-1], "E")
        ends.append(str(len(machine.blocks)))
    face = "A"
    while len(machine.blocks) < size:
        for row, end in enumerate(ends):
            if len(machine.blocks) < size:
                assert attach(machine, end, face)
                ends[row] = str(len(machine.blocks))
        face = "E"
    return machine


def median_ms(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    taken = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken) * 1e3


def attach_ms(size: int) -> float:
    """Median time of the ten attaches that bring a lattice to so many blocks."""
    taken = []
    for _ in range(ROUNDS):
        machine = lattice(size - 10)
        for end in list(machine.blocks)[-10:]:
            began = time.perf_counter()
            assert attach(machine, end, "E")
            taken.append(time.perf_counter() - began)
    return statistics.median(taken) * 1e3


def mixed_attach_ms(size: int) -> float:
    """Median time of the last twenty attaches of a machine of so many blocks of all kinds.

    Modules, bases and faces are drawn at random, the same on every run; what is refused, for
    overlap mostly, is measured with what is accepted.
    """
    taken = []
    for seed in range(ROUNDS):
        draw = random.Random(seed)
        machine = Machine(catalogue=module_set("workshop"))
        machine.act("start")
        names = machine.catalogue.attachable
        while len(machine.blocks) < size:
            base = draw.choice(list(machine.blocks.values())[-40:])
            faces = machine.state.free_faces(base)
            if not faces:
                continue
            arguments = {
                "base_block": base.id,
                "face": draw.choice(faces),
                "new_block": draw.choice(names),
            }
            began = time.perf_counter()
            machine.act("attach_block_to", arguments)
            if len(machine.blocks) > size - 20:
                taken.append(time.perf_counter() - began)
    return statistics.median(taken) * 1e3


def refine_ms(action: str, first: dict[str, object], second: dict[str, object]) -> float:
    """Median time of an action on the last block of a 200-block machine, there and back."""
    machine = lattice(200)
    taken = []
    for index in range(200):
        began = time.perf_counter()
        assert machine.act(action, second if index % 2 else first).ok
        taken.append(time.perf_counter() - began)
    return statistics.median(taken) * 1e3


def resident_mb() -> float:
    """Peak resident memory of a fresh process that builds a 200-block machine."""
    rendered = subprocess.run(
        [sys.executable, "-c", RESIDENT_PROGRAM], check=True, capture_output=True, text=True
    )
    return int(rendered.stdout) / 1024


def measure() -> list[Figure]:
    hundred = lattice(100)
    log = hundred.log
    tip = {"block_id": "200"}
    twist = refine_ms("twist_block", {**tip, "angle": 90}, {**tip, "angle": -90})
    shift = refine_ms(
        "shift_block", {**tip, "shift_real": [0.1, 0, 0]}, {**tip, "shift_real": [-0.1, 0, 0]}
    )
    at_100, at_200, at_1000 = attach_ms(100), attach_ms(200), attach_ms(1000)
    return [
        Figure(
            name="attach at 200 blocks", value=at_200, unit="ms", bar=0.15, published="12 to 16"
        ),
        Figure(
            name="attach at 200 mixed blocks",
            value=mixed_attach_ms(200),
            unit="ms",
            bar=0.15,
            published="",
        ),
        Figure(name="twist at 200 blocks", value=twist, unit="ms", bar=0.2, published="26 to 38"),
        Figure(name="shift at 200 blocks", value=shift, unit="ms", bar=0.2, published="26 to 38"),
        Figure(
            name="summary of 100 blocks",
            value=median_ms(lambda: hundred.act("get_machine_summary").text, 101),
            unit="ms",
            bar=1.0,
            published="50",
        ),
        Figure(
            name="rebuild of 100 blocks",
            value=median_ms(lambda: replay(log)),
            unit="ms",
            bar=20.0,
            published="1400",
        ),
        Figure(
            name="lattice of 1000 blocks",
            value=median_ms(lambda: lattice(1000), 5) / 1e3,
            unit="s",
            bar=0.5,
            published="",
        ),
        Figure(
            name="attach at 1000 blocks over attach at 100",
            value=at_1000 / at_100,
            unit="times",
            bar=2.0,
            published="",
        ),
        Figure(
            name="import and a 200-block machine, resident",
            value=resident_mb(),
            unit="MB",
            bar=80.0,
            published="156",
        ),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where to write the figures")
    options = parser.parse_args()
    figures = measure()
    for figure in figures:
        beside = f"  (published library: {figure.published})" if figure.published else ""
        verdict = "ok  " if figure.met else "MISS"
        rendered = f"{figure.value:.3g} {figure.unit}, bar {figure.bar:g}{beside}"
        sys.stdout.write(f"{verdict} {figure.name}: {rendered}\n")
    keep([{**asdict(figure), "met": figure.met} for figure in figures], options.json)
    return 0 if all(figure.met for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
