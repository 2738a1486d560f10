"""Measures the environment: building steps, branching, and trials over processes.

Run by `make bench-environment`. The bars are those of docs/training.md.
"""

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.figures import keep

from buildarena_environment import Environment, Evaluator
from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, SOUTH, UP, Draft

EPISODES = 200
BRANCHES = 1000
BARS = {
    "steps_per_s": 20_000,
    "branches_s": 1.0,
    "1000 trials, deck, decided, s": 120.0,
}


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument("--trials", type=int, default=120, help="trials of each kind and number")
    options = parser.parse_args()
    figures: dict[str, Any] = {
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "steps_per_s": steps_per_s(),
        "branches_s": branches_s(),
        "trials": trials(options.trials),
    }
    for kind, rates in figures["trials"].items():
        figures[f"1000 trials, {kind}, s"] = 1000 / rates[str(figures["cores"])]
    for name, value in figures.items():
        bar = f"  [{BARS[name]:g}]" if name in BARS else ""
        shown = json.dumps(value) if isinstance(value, dict) else f"{value:,.3f}"
        print(f"{name:36} {shown}{bar}")  # noqa: T201
    keep(figures, options.json)
    return 0


def deck() -> Draft:
    """A bridge of 20 blocks and 7 braces over the first gap: a row of 11, nine more at its side."""
    draft = Draft()
    middle = draft.start()
    ahead, behind = draft.row(middle, NORTH, 5), draft.row(middle, SOUTH, 5)
    row = [*reversed(behind), middle, *ahead]
    for first, second in zip(row, row[4:], strict=False):
        draft.connect(first, second, UP)
    for block in row[1:-1]:
        draft.attach(block, EAST)
    return draft


def timed(work: Callable[[], object]) -> float:
    """Seconds that it takes."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def steps_per_s() -> float:
    """Steps of an environment in one process, refused ones left out; median over episodes."""
    actions = deck().actions
    environment = Environment("support-1")

    def episode() -> None:
        environment.reset()
        for tool, arguments in actions:
            environment.step(tool, arguments)

    episode()
    return len(actions) / statistics.median(timed(episode) for _ in range(EPISODES))


def branches_s() -> float:
    """Going back to a machine of 100 blocks and taking another step, so many times."""
    draft = Draft()
    draft.row(draft.start(), NORTH, 99)
    environment = Environment("support-1")
    for tool, arguments in draft.actions:
        environment.step(tool, arguments)
    kept = environment.state()
    faces = [
        (block, face)
        for block in draft.machine.blocks
        for face in draft.machine.state.free_faces(draft.machine.blocks[block])
    ]

    def branch(number: int) -> None:
        environment.restore(kept)
        block, face = faces[number % len(faces)]
        told = {"base_block": block, "face": face, "new_block": "Small Wooden Block"}
        environment.step("attach_block_to", told)

    return timed(lambda: [branch(number) for number in range(BRANCHES)])


def trials(count: int) -> dict[str, dict[str, float]]:
    """Trials a second, by kind and number of processes.

    The deck is of 20 blocks; the braced deck has 7 connectors besides, carries three times as much
    and takes longer to fail. Decided trials end when they are decided, whole ones do not.
    """
    cores = len(os.sched_getaffinity(0))
    found: dict[str, dict[str, float]] = {}
    for name, machines in (("deck", [plain()] * count), ("braced deck", variants(count))):
        for ending, whole in (("decided", False), ("whole", True)):
            rates = found[f"{name}, {ending}"] = {}
            for processes in sorted({1, cores}):
                some = machines[: count if processes > 1 else max(20, count // 4)]
                with Evaluator("support-1", processes=processes, whole=whole) as evaluator:
                    list(evaluator.map(machines[: 2 * processes]))
                    wall_s = timed(lambda: list(evaluator.map(some)))  # noqa: B023 - called at once
                rates[str(processes)] = len(some) / wall_s
    return found


def plain() -> Machine:
    """The deck without its connectors."""
    machine = deck().machine
    for connector in list(machine.connectors):
        machine.act("remove_block", {"block_id": connector})
    return machine


def variants(count: int) -> Sequence[Machine]:
    """The braced deck, each time without another brace or none."""
    machine = deck().machine
    made = []
    for number in range(count):
        copy = machine.copy()
        links = list(copy.connectors)
        if number % (len(links) + 1) < len(links):
            copy.act("remove_block", {"block_id": links[number % (len(links) + 1)]})
        made.append(copy)
    return made


if __name__ == "__main__":
    sys.exit(main())
