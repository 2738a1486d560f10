"""What a controller costs: a tick of a program, and a trial with one; run by `make bench-control`.

The bars: 30 microseconds a tick for some fifty lines with ten senses, and a trial with a controller
1.15 times one that does the same by keys.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import tell
from support.machines.families import car

from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import ENGINES, Scenario, simulate
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.offered import Senses
from buildarena_simulation.scenario import Control

LAYOUT: Final = {
    "height": 0,
    "position": {"x": 1, "y": 2, "z": 3},
    "velocity": {"x": 4, "y": 5, "z": 6},
    "up": {"x": 7, "y": 8, "z": 9},
}
PROGRAM: Final = Path(__file__).parents[2] / "tests" / "data" / "control" / "fifty_lines.lua"
GO: Final = "function control(t, sense) return { spinning_forward = sense.height ~= 1 } end"
TICKS: Final = 20_000
BAR_US: Final = 30.0
BAR_RATIO: Final = 1.15


def tick_us() -> float:
    """Microseconds of a tick, the median of five times many."""
    program = Program(PROGRAM.read_text(encoding="utf-8"))
    program.senses_are(LAYOUT)
    values = [5.0, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.0, 0.1, 0.99]
    times = []
    for _ in range(5):
        began = time.perf_counter()
        for tick in range(TICKS // 5):
            program.answer(tick, 0.04 * tick, values)
        times.append((time.perf_counter() - began) / (TICKS // 5) * 1e6)
    return statistics.median(times)


def medians(runs: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """Processor time of calls that take turns, after a first round that warms up; medians."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats + 1):
        for name, run in runs.items():
            began = time.process_time()
            run()
            times[name].append(time.process_time() - began)
    return {name: statistics.median(each[1:]) for name, each in times.items()}


def trials(machine: Machine, engine: str, repeats: int) -> dict[str, float]:
    """A trial of ten seconds by keys, and by a program that asks for the same."""
    scenario = Scenario(duration_s=10.0, control=Control(mode="agent"), senses=Senses())
    keys = [KeyPress(time_s=0.0, key="UpArrow", hold_for_s=10.0)]
    steered = machine.with_controller(GO)
    took = medians(
        {
            "keys_s": lambda: simulate(machine, scenario, engine, controls=keys),
            "program_s": lambda: simulate(steered, scenario, engine),
        },
        repeats,
    )
    figures = took | {"ratio": took["program_s"] / took["keys_s"]}
    return {name: round(value, 3) for name, value in figures.items()}


def main() -> None:
    """Measures, prints and keeps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    large = car(9, 3, axles=3, deck_half=(2, 4))
    machines = {"car": car(), f"car of {large.part_count} parts": large}
    figures = {
        "tick_us": round(tick_us(), 1),
        "tick_bar_us": BAR_US,
        "trials": {
            name: {engine: trials(machine, engine, options.repeats) for engine in ENGINES}
            for name, machine in machines.items()
        },
        "ratio_bar": BAR_RATIO,
    }
    tell(figures, options.json)


if __name__ == "__main__":
    main()
