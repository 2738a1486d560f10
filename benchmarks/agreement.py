"""How far the engines agree on random machines; run by `make bench NAME=agreement`.

Draws machines for every built-in task, tries each on both engines, and tries those they disagree
on again at finer steps: the engine whose substeps result keeps its own verdict and indicator was
right, as far as steps decide.
"""

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks import random_throwers
from benchmarks.figures import keep
from support.machines import random_machines, random_workshop

from buildarena_benchmark import builtin_tasks, score
from buildarena_simulation import ENGINES, simulate

DRAWS = {
    "basic": (random_machines.TASKS, random_machines.random_machine, 300, 0.95),
    "workshop": (random_workshop.TASKS, random_workshop.random_workshop_machine, 120, 0.90),
    "throwing": (random_throwers.TASKS, random_throwers.random_thrower, 120, 0.95),
}
"""By set: its tasks, how a machine is drawn, how many, and the bar of equal verdicts."""
CLOSE = 0.90
TOLERANCE = 0.25
FINER = 4


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One machine on both engines.

    Attributes:
        task: The task.
        seed: Of the draw.
        success: Per engine.
        indicator: Per engine.
        flags: Per engine.
        substeps: Per engine, success and indicator at finer steps; only where they disagree.
    """

    task: str
    seed: int
    success: dict[str, bool]
    indicator: dict[str, float]
    flags: dict[str, list[str]]
    substeps: dict[str, tuple[bool, float]]

    @property
    def same(self) -> bool:
        """Whether the verdicts are equal."""
        return len(set(self.success.values())) == 1

    @property
    def both(self) -> bool:
        """Whether both engines report a success."""
        return all(self.success.values())

    @property
    def close(self) -> bool:
        """Whether the indicators are within the tolerance, where both succeed."""
        low, high = sorted(self.indicator.values())
        return not self.both or high - low <= TOLERANCE * high


def compared(modules: str, task: str, seed: int) -> Comparison:
    """One machine on both engines, and at finer steps if they disagree."""
    machine, chosen = DRAWS[modules][1](task, seed), builtin_tasks()[task]
    found = {e: score(chosen, machine, simulate(machine, chosen.scenario, e)) for e in ENGINES}
    result = Comparison(
        task=task,
        seed=seed,
        success={e: r.success for e, r in found.items()},
        indicator={e: r.indicator for e, r in found.items()},
        flags={e: list(r.flags) for e, r in found.items()},
        substeps={},
    )
    if not (result.same and result.close):
        for engine in ENGINES:
            trajectory = simulate(machine, chosen.scenario, engine, substeps=FINER)
            again = score(chosen, machine, trajectory)
            result.substeps[engine] = (again.success, again.indicator)
    return result


def _compared(given: tuple[str, str, int]) -> Comparison:
    return compared(*given)


def main() -> int:
    """Runs the benchmark.

    Returns:
        The exit code: 1 if the engines agree less than they should.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument("--set", choices=list(DRAWS), default="basic", dest="modules")
    parser.add_argument("--machines", type=int, help="300 basic ones, 120 of other sets")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    tasks, _, usual, bar = DRAWS[options.modules]
    wanted = [
        (options.modules, tasks[k % len(tasks)], options.first_seed + k // len(tasks))
        for k in range(options.machines or usual)
    ]
    started = time.monotonic()
    with ProcessPoolExecutor(options.processes) as pool:
        results = list(pool.map(_compared, wanted, chunksize=1))
    figures = _figures(results)
    _print(results, figures, time.monotonic() - started, bar)
    keep({**figures, "machines": [asdict(result) for result in results]}, options.json)
    return 0 if figures["same_verdict"] >= bar and figures["close"] >= CLOSE else 1


def _figures(results: list[Comparison]) -> dict[str, float]:
    both = [result for result in results if result.both]
    return {
        "count": len(results),
        "same_verdict": sum(result.same for result in results) / len(results),
        "both_succeed": len(both),
        "close": sum(result.close for result in both) / max(len(both), 1),
    }


def _print(
    results: list[Comparison], figures: dict[str, float], seconds: float, bar: float
) -> None:
    _say(f"{'task':14s}{'machines':>9s}{'same verdict':>14s}{'both succeed':>14s}{'close':>8s}")
    for task in dict.fromkeys(result.task for result in results):
        of_task = [result for result in results if result.task == task]
        both = [result for result in of_task if result.both]
        same, close = sum(r.same for r in of_task), sum(r.close for r in both)
        _say(f"{task:14s}{len(of_task):9d}{same:14d}{len(both):14d}{close:8d}")
    _say("disagreements, with the results at finer steps:")
    for result in results:
        if result.substeps:
            _say(f"  {result.task} seed {result.seed}: {_side(result)}")
    _say(
        f"same verdict {figures['same_verdict']:.1%} (bar {bar:.0%}); indicators within "
        f"{TOLERANCE:.0%} where both succeed {figures['close']:.1%} (bar {CLOSE:.0%}); "
        f"{figures['count']} machines in {seconds:.0f} s"
    )


def _side(result: Comparison) -> str:
    parts = []
    for engine in ENGINES:
        usual = (
            f"{'success' if result.success[engine] else 'failure'} {result.indicator[engine]:,.1f}"
        )
        success, indicator = result.substeps[engine]
        substeps = f"{'success' if success else 'failure'} {indicator:,.1f}"
        parts.append(f"{engine} {usual} {result.flags[engine]} (substeps: {substeps})")
    return "; ".join(parts) + f" -> {_right(result)}"


def _right(result: Comparison) -> str:
    """Who was right: the engines whose usual result both substeps ones confirm."""
    verdicts = {success for success, _ in result.substeps.values()}
    if len(verdicts) > 1:
        return "finer steps do not settle it"
    if result.same:
        middle = sum(indicator for _, indicator in result.substeps.values()) / len(ENGINES)
        nearest = min(ENGINES, key=lambda e: abs(result.indicator[e] - middle))
        return f"{nearest} nearer to the substeps indicators"
    return next(e for e in ENGINES if result.success[e] == verdicts.copy().pop()) + " right"


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


if __name__ == "__main__":
    sys.exit(main())
