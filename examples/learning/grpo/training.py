"""A training run: updates, tests before and after them, and what is kept of it."""

from __future__ import annotations

import argparse
import asyncio
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import jax
import numpy as np
from languages import LANGUAGES, Language
from network import Writer, ignorant
from optimisation import Learner, advantages, batch_of, improved
from rollouts import Player, Rollout, player

from buildarena_simulation import ENGINES, SIMULATION_VERSION

TRAINED_ON: Final = tuple(range(1, 9))
HELD_OUT: Final = tuple(range(101, 109))
"""Seeds of starts. A policy is tested from others than it was trained on."""
TESTS: Final = 4
"""Rollouts from each start of a test."""
UPDATE, TEST = 1, 2
"""What numbers are drawn for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What a run's curve follows from, beside the versions of what it runs on.

    Attributes:
        task: The task.
        seed: Of weights and words.
        updates: Of the weights.
        groups: Starts an update.
        rollouts: Rollouts from each of them.
        simulator: The engine.
    """

    task: str
    seed: int
    updates: int
    groups: int
    rollouts: int
    simulator: str
    simulation_version: str = SIMULATION_VERSION


@dataclass(slots=True, kw_only=True)
class Run:
    """What a run has come to.

    Attributes:
        setting: Its own.
        tests: What the policy is worth from starts that were held out, before and after.
        updates: What the rollouts of each update were worth.
        best: The words of the best rollout.
        minutes: How long it took, in all its parts.
    """

    setting: Setting
    tests: dict[str, dict[str, float]] = field(default_factory=dict)
    updates: list[dict[str, float]] = field(default_factory=list)
    best: dict[str, Any] = field(default_factory=dict)
    minutes: float = 0.0


def worth(rollouts: list[Rollout]) -> dict[str, float]:
    """Rewards and successes of rollouts, in short."""
    rewards = [rollout.reward for rollout in rollouts]
    return {
        "mean": round(float(np.mean(rewards)), 4),
        "best": round(max(rewards), 4),
        "success": round(float(np.mean([rollout.success for rollout in rollouts])), 4),
        "refused": round(float(np.mean([rollout.refused for rollout in rollouts])), 2),
    }


async def update(
    players: Player, learner: Learner, run: Run, number: int
) -> tuple[Learner, list[Rollout]]:
    """Plays groups of rollouts, and learns from them."""
    setting = run.setting
    first = (number - 1) * setting.groups
    rows = [(first + place) % len(TRAINED_ON) for place in range(setting.groups)]
    players.writer.weights = learner.weights
    groups = await players.play(
        rows, rollouts=setting.rollouts, seed=(setting.seed, UPDATE, number)
    )
    told = advantages([[rollout.reward for rollout in group] for group in groups])
    played = [rollout for group in groups for rollout in group]
    batch = batch_of(players.writer.language, [(rollout.words, rollout.own) for rollout in played])
    return improved(learner, batch, told.reshape(-1).astype(np.float32)), played


async def test(players: Player, run: Run, when: str) -> None:
    """Plays from the starts that were held out."""
    rows = [len(TRAINED_ON) + place for place in range(len(HELD_OUT))]
    groups = await players.play(rows, rollouts=TESTS, seed=(run.setting.seed, TEST))
    run.tests[when] = worth([rollout for group in groups for rollout in group])
    print(when, run.tests[when], flush=True)


async def train(players: Player, learner: Learner, run: Run, out: Path) -> None:
    """Goes on with a run until it has all its updates, and keeps it after each of them."""
    async with players.environment.serving():
        before = run.minutes
        started = time.monotonic()
        if not run.updates:
            await test(players, run, "before")
        while len(run.updates) < run.setting.updates:
            number = len(run.updates) + 1
            learner, played = await update(players, learner, run, number)
            run.updates.append({"number": number, **worth(played)})
            best = max(played, key=lambda rollout: rollout.reward)
            if best.reward > run.best.get("reward", -1.0):
                written = [word for word, own in zip(best.words, best.own, strict=True) if own]
                run.best = {"reward": best.reward, "written": " ".join(written)}
            run.minutes = round(before + (time.monotonic() - started) / 60, 2)
            print(run.updates[-1], run.minutes, flush=True)
            kept(run, learner, out)
        players.writer.weights = learner.weights
        await test(players, run, "after")
        kept(run, learner, out)


def kept(run: Run, learner: Learner, out: Path) -> None:
    """Writes run and weights, each whole or not at all.

    The weights come last and say how many updates they have: a run is never behind them.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "run.json.part").write_text(json.dumps(asdict(run), indent=1) + "\n", encoding="utf-8")
    (out / "run.json.part").replace(out / "run.json")
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(learner)]
    with (out / "learner.npz.part").open("wb") as file:
        np.savez(file, *leaves, updates=len(run.updates))
    (out / "learner.npz.part").replace(out / "learner.npz")


def begun(setting: Setting, language: Language, out: Path) -> tuple[Run, Learner]:
    """A new run, or the one in a folder as far as it is.

    Raises:
        ValueError: The one in the folder has another setting; its updates may become more.
    """
    learner = Learner.beginning(ignorant(language, setting.seed))
    if not (out / "learner.npz").exists():
        return Run(setting=setting), learner
    told = json.loads((out / "run.json").read_text(encoding="utf-8"))
    if {**told["setting"], "updates": setting.updates} != asdict(setting):
        raise ValueError(f"{out} has a run with another setting, {told['setting']}: name another")
    with np.load(out / "learner.npz") as stored:
        count = int(stored["updates"])
        leaves = [stored[f"arr_{place}"] for place in range(len(jax.tree.leaves(learner)))]
    run = Run(**{**told, "setting": setting, "updates": told["updates"][:count]})
    structure = jax.tree.structure(learner)
    return run, jax.tree.unflatten(structure, [jax.numpy.asarray(leaf) for leaf in leaves])


def main(description: str | None) -> None:
    """Trains as the command line says, and writes into a folder."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--task", choices=LANGUAGES, required=True)
    parser.add_argument("--seed", type=at_least(0), default=0)
    parser.add_argument("--updates", type=at_least(1), default=40)
    parser.add_argument("--groups", type=at_least(1), default=2, help="of an update")
    parser.add_argument("--rollouts", type=at_least(2), default=16, help="of a group")
    parser.add_argument("--simulator", choices=sorted(ENGINES), default="mujoco")
    parser.add_argument("--processes", type=at_least(1), default=1, help="that try machines")
    parser.add_argument("--out", type=Path, required=True)
    options = vars(parser.parse_args())
    out, processes = options.pop("out"), options.pop("processes")
    setting = Setting(**options)
    language = LANGUAGES[setting.task]
    try:
        run, learner = begun(setting, language, out)
    except ValueError as error:
        parser.error(str(error))
    with player(
        Writer(language, learner.weights),
        start_seeds=[*TRAINED_ON, *HELD_OUT],
        simulator=setting.simulator,
        processes=processes,
    ) as players:
        asyncio.run(train(players, learner, run, out))


def at_least(least: int) -> Callable[[str], int]:
    """What reads a whole number of the command line."""

    def read(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} on")
        return int(text)

    return read
