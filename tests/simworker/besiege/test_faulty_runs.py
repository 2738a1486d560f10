"""Runs in a game that misbehaves: three in the night, 200 in `make scenario NAME=besiege`."""

import os
import subprocess
import sys

import pytest
from support.game.game_rig import SUPPORT

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(240)]
RUNS = int(os.environ.get("BESIEGE_FAULTY_RUNS", "0"))
SEEDS = range(RUNS) or (4, 7, 10)
"""A dialog in the way three times; a crash and a stolen clipboard; lines lost and cut off."""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_fault_ends_in_a_right_score_or_in_a_sentence_with_a_picture(
    tmp_path, screen, seed
) -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "support.game.faulty_runs",
            str(tmp_path),
            "--first",
            str(seed),
            "--runs",
            "1",
        ],
        env={**os.environ, **screen, "PYTHONPATH": SUPPORT},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
