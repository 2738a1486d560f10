"""Many runs in a game that misbehaves: each ends in a right score, or in a fault with its proof.

A program of its own, because PyAutoGUI takes the screen that its process was started with.
"""

import argparse
import json
import os
import random
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from support.game.game_rig import TRIALS, Rig, our_score, short_trial, trial_of
from support.game.stand_in_game.faults import KINDS, MOVABLE, POINTS

from buildarena_benchmark import Score, Task, score
from buildarena_geometry import Machine

NEAR = 0.02
"""A score is right when its indicator is so near to the engine's, as a share."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How one run ended."""

    seed: int
    task: str
    faults: list[dict[str, Any]]
    ended: str
    detail: str
    seconds: float


def drawn_faults(seed: int) -> list[dict[str, Any]]:
    """One to three faults of any kind at any point."""
    draw = random.Random(seed)
    found = []
    for _ in range(draw.randint(1, 3)):
        kind = draw.choice(sorted(KINDS))
        fault: dict[str, Any] = {"fault": kind}
        if kind in MOVABLE:
            fault["at"] = draw.choice([point for point in POINTS if point != "copy"])
        if kind == "freeze":
            fault["seconds"] = draw.choice([1.0, 3.0, None])
        if kind in {"freeze", "crash"} and fault["at"] == "simulating":
            fault["after_s"] = draw.uniform(0.0, 5.0)
        fault["times"] = draw.choice([1, 1, 1, 3, None]) if kind not in {"freeze", "crash"} else 1
        found.append(fault)
    return found


def run_one(rig: Rig, seed: int, trials: dict[str, tuple[Task, Machine, Score]]) -> Run:
    """Plays one run and judges how it ended."""
    from buildarena_backend.trials.simulator import SimulatorFaultError
    from buildarena_simworker.besiege.set_up import make_desktop
    from buildarena_simworker.besiege.settings import BesiegeSettings
    from buildarena_simworker.besiege.simulator import BesiegeSimulator

    name = sorted(trials)[seed % len(trials)]
    task, machine, right = trials[name]
    faults = drawn_faults(seed)
    rig.faults.write_text(json.dumps(faults))
    settings = BesiegeSettings()
    desktop, facts = make_desktop(settings)
    simulator = BesiegeSimulator(settings, desktop, facts)
    trial = trial_of(task, machine, job_id=f"job_{seed:010d}")
    started = time.monotonic()
    try:
        done = simulator.run(trial)
    except SimulatorFaultError as fault:
        detail = str(fault)
        ended = "fault" if fault.files and detail else "a fault without a picture or a sentence"
    except Exception as error:  # noqa: BLE001 - whatever else ends a run is a finding
        ended, detail = f"broke off with {type(error).__name__}", str(error)
    else:
        found = score(task, machine, done.trajectory)
        detail = f"{found.success} {found.indicator:.2f}, engine {right.indicator:.2f}"
        ended = "right" if _same(found, right) else "WRONG SCORE"
    finally:
        left = [file.name for file in rig.machines.iterdir()] if not _is_clean(rig) else []
        simulator.close()
    if ended in {"right", "fault"} and (left or list(rig.machines.iterdir())):
        ended = f"left behind: {left or [file.name for file in rig.machines.iterdir()]}"
    return Run(
        seed=seed,
        task=name,
        faults=faults,
        ended=ended,
        detail=detail,
        seconds=round(time.monotonic() - started, 1),
    )


def _same(found: Score, right: Score) -> bool:
    near = abs(found.indicator - right.indicator) <= NEAR * max(abs(right.indicator), 1.0)
    return found.success == right.success and near


def _is_clean(rig: Rig) -> bool:
    """Whether no machine file is left, and the game holds no machine and no key."""
    if list(rig.machines.iterdir()):
        return False
    try:
        report = rig.report()
    except (OSError, ValueError):
        return True
    return not report["modifiers"]


def main() -> None:
    """Runs a range of seeds; one JSON line each; exit code 1 if any ended badly."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--runs", type=int, default=4)
    given = parser.parse_args()
    rig = Rig(folder=given.folder)
    os.environ.update(rig.environment())
    rig.calibrate()
    trials = {}
    for name in TRIALS:
        task, machine = short_trial(name)
        trials[name] = (task, machine, our_score(task, machine))
    ends: Counter[str] = Counter()
    for seed in range(given.first, given.first + given.runs):
        run = run_one(rig, seed, trials)
        ends[run.ended if run.ended in {"right", "fault"} else "bad"] += 1
        sys.stdout.write(json.dumps(asdict(run)) + "\n")
        sys.stdout.flush()
    sys.stderr.write(f"{dict(ends)}\n")
    sys.exit(1 if ends["bad"] else 0)


if __name__ == "__main__":
    main()
