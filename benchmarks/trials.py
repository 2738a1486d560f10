"""What whole trials cost, and many of one machine; run by `make bench NAME=trials`.

All figures are processor time but the wall time of the large number. Of each engine: the expert's
trial of support-1 with the share of it that the engine itself steps, 1,000 trials of a bridge of 20
blocks on two cores (some of them, scaled), 20 seeds and 4 worlds of a machine against one trial,
and a trial with a controller against one that does the same by keys.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import tell
from support.machines.expert_calls import built
from support.machines.families import car, deck

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.scores import simulate_task
from buildarena_geometry import KeyPress, Machine, catalogue_of
from buildarena_simulation import ENGINES, Scenario, simulate
from buildarena_simulation.scenario import Control
from buildarena_simulation.sensor_config import Senses

TASK: Final = "support-1"
BLOCKS: Final = 20
MANY: Final = 1_000
CORES: Final = 2
SEEDS: Final = 20
WORLDS: Final = 4
RATIOS: Final = {"seeds_over_one": 6.0, "worlds_over_one": 2.5, "controller_over_keys": 1.15}
BARS: Final = {
    "mujoco": {"trial_s": 0.3, "worlds_s": 0.9, "thousand_wall_s": 90.0, **RATIOS},
    "pybullet": {"trial_s": 0.7, "worlds_s": 2.0, "thousand_wall_s": 220.0, **RATIOS},
}
_STEPS: Final = {"mujoco": "mj_step", "pybullet": "stepSimulation"}

GO: Final = "function control(t, sense) return { spinning_forward = sense.height ~= 1 } end"


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


def experts_bridge() -> Machine:
    """What the expert builds for the task."""
    return built(expert_designs()[TASK](0), Machine(catalogue=catalogue_of("all")))


def bridge() -> Machine:
    """A deck three blocks wide that lacks one corner."""
    machine = deck(3, 7)
    corner = max(machine.blocks.values(), key=lambda block: tuple(block.center_xyz)).id
    outcome = machine.act("remove_block", {"block_id": corner})
    assert outcome.ok, outcome.text
    assert len(machine.blocks) == BLOCKS, len(machine.blocks)
    return machine


def processor_s(call: Callable[[], Any]) -> float:
    """Processor time of a call."""
    began = time.process_time()
    call()
    return time.process_time() - began


def median_s(call: Callable[[], Any], repeats: int) -> float:
    """The median of several calls, after one that warms up."""
    return statistics.median([processor_s(call) for _ in range(repeats + 1)][1:])


@contextmanager
def stepping(engine: str) -> Iterator[list[int]]:
    """Collects the processor time of the engine's own steps, nanoseconds."""
    library, name, spent = import_module(engine), _STEPS[engine], [0]
    step = getattr(library, name)

    def timed(*arguments: Any, **named: Any) -> Any:
        began = time.thread_time_ns()
        result = step(*arguments, **named)
        spent[0] += time.thread_time_ns() - began
        return result

    setattr(library, name, timed)
    try:
        yield spent
    finally:
        setattr(library, name, step)


def of_expert(engine: str, repeats: int) -> dict[str, float]:
    """The expert's trial until it is decided, whole, its engine's steps, and what precedes them."""
    task = builtin_tasks()[TASK]
    machine = experts_bridge()
    run = partial(simulate_task, task, machine, engine)
    decided, whole = median_s(run, repeats), median_s(partial(run, to_end=True), repeats)
    steps = []
    for _ in range(repeats):
        with stepping(engine) as spent:
            run()
        steps.append(spent[0] / 1e9)
    nothing = task.scenario.model_copy(update={"duration_s": 0.04})
    building = median_s(partial(simulate, machine, nothing, engine), repeats)
    return {
        "trial_s": decided,
        "whole_trial_s": whole,
        "steps_s": statistics.median(steps),
        "building_s": building,
    }


def played(machine: Machine, engine: str, seeds: Iterable[int]) -> float:
    """Processor time of a machine's trials with some seeds, each until it is decided."""
    task = builtin_tasks()[TASK]
    return processor_s(lambda: [simulate_task(task, machine, engine, seed=seed) for seed in seeds])


def against_one(engine: str, one_s: float, repeats: int) -> dict[str, float]:
    """Of the expert's bridge, 20 seeds and 4 worlds against one trial in the exact world."""
    run = partial(played, experts_bridge(), engine)
    worlds = statistics.median(run(range(WORLDS)) for _ in range(repeats))
    return {
        "worlds_s": worlds,
        "seeds_over_one": run(range(SEEDS)) / one_s,
        "worlds_over_one": worlds / one_s,
    }


def in_process(engine: str, seeds: range) -> float:
    """Processor time of the bridge's trials with some seeds."""
    return played(bridge(), engine, seeds)


def thousand(engine: str, sample: int) -> dict[str, float]:
    """Wall and processor time of 1,000 trials on two cores, from a sample of them."""
    scale, half = MANY / sample, sample // CORES
    with ProcessPoolExecutor(CORES, mp_context=get_context("spawn")) as pool:
        list(pool.map(partial(in_process, engine), [range(1)] * CORES))
        began = time.perf_counter()
        parts = [range(core * half, (core + 1) * half) for core in range(CORES)]
        spent = sum(pool.map(partial(in_process, engine), parts))
        wall = time.perf_counter() - began
    return {
        "thousand_wall_s": wall * scale,
        "thousand_processor_s": spent * scale,
        "sampled_trials": sample,
    }


def figures_of(engine: str, repeats: int, sample: int) -> dict[str, float]:
    """All figures of an engine."""
    figures = of_expert(engine, repeats)
    figures |= against_one(engine, figures["trial_s"], repeats)
    figures |= thousand(engine, sample)
    figures["controller_over_keys"] = trials(car(), engine, repeats)["ratio"]
    return {name: round(value, 3) for name, value in figures.items()}


def main() -> None:
    """Measures, prints and keeps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--sample", type=int, default=40, help="trials of the thousand; even")
    options = parser.parse_args()
    figures = {engine: figures_of(engine, options.repeats, options.sample) for engine in ENGINES}
    tell({"task": TASK, "bars": BARS, **figures}, options.json)


if __name__ == "__main__":
    main()
