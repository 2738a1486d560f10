"""Measures the simulation: speed, growth, memory, and how far the engines agree.

Run by `make bench NAME=simulation`. Speed is processor time (wall time on a free core) per
simulated second, loads on, building the world included: the median of several runs of a support
trial whose cargo grows to a mass that nothing breaks under.
"""

import argparse
import resource
import statistics
import sys
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from support.machines.building import KeyedDraft
from support.machines.families import beam, deck, lattice, mechanism
from support.machines.references import REFERENCES, load_machine, outcome

from buildarena_benchmark import builtin_tasks, score
from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP, WEST
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, Scenario, simulate
from buildarena_simulation.scenario import ReleasedPlacement

SECONDS = 17.0
LOAD = 100.0
REPEATS = 5
BARS = {
    ("100 blocks, 30 braces", "mujoco"): 0.04,
    ("100 blocks, 30 braces", "pybullet"): 0.10,
    ("car", "mujoco"): 0.05,
    ("car with cargo", "mujoco"): 0.05,
    ("airship of 60 parts", "mujoco"): 0.05,
    ("airship of 60 parts", "pybullet"): 0.15,
    ("60 parts, 20 joints", "mujoco"): 0.05,
    ("60 parts, 20 joints", "pybullet"): 0.15,
}
TASK_OF_CASE = {
    "deck that collapses": "support-1",
    "car": "transport-1",
    "car with cargo": "transport-2",
    "60 parts, 20 joints": "transport-1",
}
"""Cases tried in a task's own scenario; the others under a load that breaks nothing."""
AIRSHIP = "airship of 60 parts"
"""Wings, blades, fans, balloons and springs, let go high up."""
INDICATOR_TOLERANCE = 0.25
_CHOICES: tuple[Any, ...] = ((1, 3, 5), (False, True), ("", "t", "b"), (0, 5))


def airship() -> Machine:
    """A long frame of sixty parts with wings, blades, fans, balloons and springs."""
    draft = KeyedDraft(modules="workshop")
    start = draft.start()
    south = draft.row(start, SOUTH, 12)
    spine = [*reversed(south), start, *draft.row(start, NORTH, 12)]
    for k in range(1, 24, 4):
        for side in (EAST, WEST):
            draft.placed(spine[k], side, "Wing Panel", UP)
    for k in range(0, 25, 3):
        draft.attach(spine[k], UP, "Balloon")
    for k in range(3, 23, 4):
        draft.attach(spine[k], DOWN, "Flying Block")
    for k in (1, 5, 13, 17):
        draft.placed(spine[k], DOWN, "Propeller", NORTH)
    for k in (0, 24):
        draft.placed(spine[k], DOWN, "Drag Block", NORTH)
    for k in (2, 10, 16):
        draft.connect(spine[k], spine[k + 6], DOWN, connector="Spring")
    return draft.machine


def main() -> int:
    """Runs the benchmark.

    Returns:
        The exit code: 1 if the engines agree less than they should.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument(
        "--sweep", action="store_true", help="compare the engines on 74 random bridges too"
    )
    parser.add_argument("--speed-only", action="store_true", help="leave out the agreement")
    options = parser.parse_args()
    figures: dict[str, Any] = {"speed": _speed()}
    agreement = None if options.speed_only else _agreement()
    figures["agreement"] = agreement
    if options.sweep:
        figures["sweep"] = _sweep()
    figures["peak_memory_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    _say(f"\npeak memory {figures['peak_memory_mb']:.0f} MB (bar 400)")
    keep(figures, options.json)
    return 0 if agreement is None or agreement["passed"] else 1


def _speed() -> dict[str, dict[str, float]]:
    cases = {
        "beam of 7": beam(7),
        "100 blocks, 30 braces": lattice(7, 15, 30),
        "300 blocks, 90 braces": lattice(13, 23, 90),
        "deck that collapses": lattice(7, 15, 30),
        "car": load_machine("car"),
        "car with cargo": load_machine("carrier"),
        AIRSHIP: airship(),
        "60 parts, 20 joints": mechanism(),
    }
    _say(f"{'seconds per simulated second':34s}" + "".join(f"{e:>20s}" for e in ENGINES))
    figures: dict[str, dict[str, float]] = {}
    for name, machine in cases.items():
        figures[name] = {engine: _seconds_per_second(name, machine, engine) for engine in ENGINES}
        cells = [
            f"{figures[name][engine]:.4f}"
            + (f" (bar {BARS[name, engine]})" if (name, engine) in BARS else "")
            for engine in ENGINES
        ]
        _say(f"{name:34s}" + "".join(f"{cell:>20s}" for cell in cells))
    small, large = (figures[name] for name in list(cases)[1:3])
    growth = {engine: large[engine] / small[engine] for engine in ENGINES}
    cells = [f"{growth[engine]:.1f} (bar {3**1.5:.1f})" for engine in ENGINES]
    _say(f"{'growth from 100 to 300 blocks':34s}" + "".join(f"{cell:>20s}" for cell in cells))
    figures["growth"] = growth
    return figures


def _scenario(name: str) -> Scenario:
    if name == AIRSHIP:
        place = ReleasedPlacement(height=1000.0, velocity=(0.0, 15.0, 0.0))
        return Scenario(duration_s=SECONDS, placement=place)
    tasks = builtin_tasks()
    scenario = tasks[TASK_OF_CASE.get(name, "support-1")].scenario
    changes: dict[str, Any] = {"duration_s": SECONDS}
    if name not in TASK_OF_CASE:
        changes["cargo"] = scenario.cargo.model_copy(update={"final_mass": LOAD})
    return scenario.model_copy(update=changes)


def _seconds_per_second(name: str, machine: Machine, engine: str) -> float:
    scenario = _scenario(name)
    warm_up = scenario.model_copy(update={"duration_s": 0.2})
    simulate(machine, warm_up, engine)
    costs = []
    for _ in range(REPEATS):
        start = time.process_time()
        simulate(machine, scenario, engine)
        costs.append((time.process_time() - start) / SECONDS)
    return statistics.median(costs)


def _agreement() -> dict[str, Any]:
    """Every reference machine on both engines."""
    first, second = ENGINES
    _say(f"\n{'machine':30s}{'task':13s}{first:>22s}{second:>22s}  agree")
    rows, same, close, both = [], 0, 0, 0
    for name, reference in REFERENCES.items():
        found = {engine: outcome(name, engine) for engine in ENGINES}
        a, b = found[first], found[second]
        verdict = a["success"] == b["success"]
        same += verdict
        near = True
        if a["success"] and b["success"]:
            both += 1
            apart = abs(a["indicator"] - b["indicator"])
            near = apart <= INDICATOR_TOLERANCE * max(a["indicator"], b["indicator"])
            close += near
        cells = [
            f"{'success' if found[e]['success'] else 'failure'} {found[e]['indicator']:12,.2f}"
            for e in ENGINES
        ]
        sign = "yes" if verdict and near else "no"
        _say(f"{name:30s}{reference.task:13s}{cells[0]:>22s}{cells[1]:>22s}  {sign}")
        rows.append({"machine": name, "task": reference.task, **found})
    share = same / len(REFERENCES)
    _say(
        f"same verdict: {same} of {len(REFERENCES)} ({share:.1%}, bar 95 %); "
        f"indicators within {INDICATOR_TOLERANCE:.0%} where both succeed: {close} of {both}"
    )
    return {
        "same_verdict": share,
        "indicators_close": close / both,
        "machines": rows,
        "passed": share >= 0.95,
    }


def _bridges() -> Iterator[tuple[str, Machine]]:
    """Every deck of some widths, lengths, braces and pillars, whatever it is good for."""
    for task, length in (("support-1", 7), ("support-1", 9), ("support-2", 11), ("support-2", 13)):
        for width, cross, along, pillars in product(*_CHOICES):
            skipped = (
                (width == 1 and (cross or pillars))
                or (width == 5 and along == "t")
                or (length in (9, 11) and along == "b")
            )
            if not skipped:
                yield task, deck(width, length, cross=cross, along=along, pillars=pillars)


def _sweep() -> dict[str, float]:
    tasks = builtin_tasks()
    count = same = both = close = broke = early = 0
    for name, machine in _bridges():
        task = tasks[name]
        a, b = (score(task, machine, simulate(machine, task.scenario, e)) for e in ENGINES)
        count += 1
        same += a.success == b.success
        if a.success and b.success:
            both += 1
            larger = max(a.indicator, b.indicator)
            close += abs(a.indicator - b.indicator) <= INDICATOR_TOLERANCE * larger
        first = [r.metrics["load_at_first_break"] for r in (a, b)]
        if None not in first:
            broke += 1
            early += abs(first[0] - first[1]) <= 0.1 * max(first)
    _say(
        f"\nrandom bridges: same verdict {same} of {count}; indicators within 25 % "
        f"{close} of {both}; load at the first break within 10 % {early} of {broke}"
    )
    return {
        "bridges": count,
        "same_verdict": same / count,
        "indicators_close": close / both,
        "first_breaks_close": early / broke,
    }


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


if __name__ == "__main__":
    sys.exit(main())
