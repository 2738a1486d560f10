"""A runner killed at any step: the next one cleans up and plays the run again."""

import json
import os
import random
import subprocess
import sys
import time

import pytest
from support.game.game_rig import Rig, our_score, short_trial

pytestmark = pytest.mark.timeout(900)
KILLS = int(os.environ.get("BESIEGE_KILLS", "3"))
LONGEST_S = 9.0
"""A run from the game's start to its end takes a little less."""


def runner(rig: Rig, screen: dict[str, str]) -> subprocess.Popen[str]:
    environment = {**os.environ, **rig.environment(), **screen}
    words = [sys.executable, "-m", "support.game.one_run", str(rig.folder)]
    return subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)


@pytest.mark.ci
def test_the_next_runner_cleans_up_and_plays_the_run_again(clean, screen) -> None:
    task, machine = short_trial("transport-1")
    right = our_score(task, machine)
    draw = random.Random(KILLS)
    for number in range(KILLS):
        with runner(clean, screen) as killed:
            # Spread over the whole run: each kill meets another step.
            time.sleep(1.5 + (LONGEST_S - 1.5) * (number + draw.random()) / KILLS)
            killed.kill()
    with runner(clean, screen) as last:
        told, _ = last.communicate(timeout=120)
    assert last.returncode == 0
    success, indicator = json.loads(told)
    assert success == right.success
    assert indicator == pytest.approx(right.indicator, rel=0.01)
    assert not list(clean.machines.iterdir())
    assert not (clean.folder / "state" / "run.json").exists()
    report = clean.report()
    assert (report["phase"], report["machine"]) == ("build", None)
    assert report["modifiers"] == []
