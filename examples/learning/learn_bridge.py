"""Learns a bridge from rewards alone: no language model, no example, no gradient.

A policy draws bridges, the environment builds and tries them, and the policy moves towards the
choices of the best (the cross-entropy method). The same seed gives the same bridges, however many
processes try them. `python examples/learning/learn_bridge.py --minutes 20`
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from policy import Bridge, Policy, built

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.flags import is_disqualified
from buildarena_environment import (
    Environment,
    Evaluation,
    Evaluator,
    Trial,
    references,
    try_machine,
)
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES

TASK = "support-1"
BRIDGES = 48
"""Bridges a generation."""
ELITE = 6
STEP = 0.4
FLOOR = 0.004
"""So likely every choice stays, so that nothing is ever given up for good."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A bridge and what came of it.

    Attributes:
        bridge: The choices.
        machine: The machine.
        reward: Its indicator over the expert's; 0 where a flag disqualifies it.
        parts: Blocks and connectors.
    """

    bridge: Bridge
    machine: Machine
    reward: float
    parts: int

    @property
    def worth(self) -> tuple[float, int]:
        """What is compared: the reward, and among equals the fewer parts."""
        return round(self.reward, 3), -self.parts


@dataclass(frozen=True, slots=True, kw_only=True)
class Generation:
    """What a generation was like; rewards are shares of the expert's indicator."""

    number: int
    minutes: float
    trials: int
    mean: float
    elite: float
    best: float
    best_parts: int


def generation_of(
    policy: Policy, evaluator: Evaluator, draw: np.random.Generator, *, count: int
) -> list[Tried]:
    """Draws, builds and tries bridges; best first."""
    environment = Environment(TASK)
    bridges = [policy.sample(draw) for _ in range(count)]
    machines = []
    for bridge in bridges:
        built(environment, bridge)
        machines.append(environment.machines["main"].copy())
    found = [
        Tried(bridge=bridge, machine=machine, reward=_reward(one), parts=machine.part_count)
        for bridge, machine, one in zip(bridges, machines, evaluator.map(machines), strict=True)
    ]
    return sorted(found, key=lambda tried: tried.worth, reverse=True)


def _reward(found: Evaluation) -> float:
    if found.trial is None or is_disqualified(found.trial.score.flags):
        return 0.0
    return found.trial.score.indicator / references()[TASK]


def learn(
    *,
    seed: int,
    generations: int,
    minutes: float,
    bridges: int = BRIDGES,
    processes: int | None = None,
) -> tuple[list[Generation], list[Tried]]:
    """Learns until the generations or the minutes are over.

    Returns:
        What each generation was like, and the best bridges of all, best first.
    """
    draw, policy = np.random.default_rng(seed), Policy.ignorant()
    started = time.monotonic()
    history: list[Generation] = []
    kept: list[Tried] = []
    with Evaluator(TASK, processes=processes, whole=False) as evaluator:
        for number in range(1, generations + 1):
            tried = generation_of(policy, evaluator, draw, count=bridges)
            kept = sorted([*tried, *kept], key=lambda one: one.worth, reverse=True)[:ELITE]
            policy = policy.towards([one.bridge for one in kept], step=STEP, floor=FLOOR)
            history.append(_told(number, (time.monotonic() - started) / 60, tried, kept[0]))
            print(history[-1])
            if history[-1].minutes >= minutes:
                break
    return history, kept


def _told(number: int, minutes: float, tried: Sequence[Tried], best: Tried) -> Generation:
    rewards = [one.reward for one in tried]
    return Generation(
        number=number,
        minutes=round(minutes, 2),
        trials=number * len(tried),
        mean=round(float(np.mean(rewards)), 4),
        elite=round(float(np.mean(rewards[:ELITE])), 4),
        best=round(best.reward, 4),
        best_parts=best.parts,
    )


def verified(machine: Machine) -> dict[str, Trial]:
    """The machine's whole trials, by engine."""
    task = builtin_tasks()[TASK]
    return {engine: try_machine(task, machine, engine) for engine in ENGINES}


def best_on_both(kept: Sequence[Tried]) -> tuple[Tried, dict[str, Trial]]:
    """The bridge whose worse engine thinks most of it, and its trials."""
    trials = [verified(one.machine) for one in kept]

    def least(number: int) -> tuple[float, int]:
        told = trials[number].values()
        return min(t.score.indicator if t.counts else 0.0 for t in told), -kept[number].parts

    chosen = max(range(len(kept)), key=least)
    return kept[chosen], trials[chosen]


def main() -> None:
    """Learns, and writes curve, machine and verdicts into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--generations", type=int, default=1000)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--processes", type=int, help="by default one for each core")
    parser.add_argument("--out", type=Path, default=Path("learned"))
    options = parser.parse_args()
    history, kept = learn(
        seed=options.seed,
        generations=options.generations,
        minutes=options.minutes,
        processes=options.processes,
    )
    best, trials = best_on_both(kept)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "curve.csv").open("w", newline="", encoding="utf-8") as file:
        names = list(Generation.__slots__)
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([getattr(one, name) for name in names] for one in history)
    machine = options.out / "bridge.machine.json"
    machine.write_text(json.dumps(best.machine.to_document()) + "\n", encoding="utf-8")
    told = {engine: trial.as_document() for engine, trial in trials.items()}
    (options.out / "verdicts.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    for engine, trial in told.items():
        print(f"{engine}: {trial['indicator']} {trial['flags']}")


if __name__ == "__main__":
    main()
