"""Builders of examples/builders: computed from what a model is told, they succeed at once."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.machines.piloted import FASTER_FIRST

EXAMPLES = Path(__file__).parents[2] / "examples" / "builders"
LEAST = {"throw": 30.0, "place": 0.5, "line": 4.0, "hover": 0.3}
"""The least indicator, by builder."""


@pytest.mark.parametrize("engine", FASTER_FIRST)
@pytest.mark.parametrize("builder", LEAST)
@pytest.mark.nightly
def test_a_computed_machine_succeeds_after_its_tests(builder, engine) -> None:
    assert submitted(builder, engine, 1) >= LEAST[builder]


@pytest.mark.ci
def test_a_computed_catapult_throws_far() -> None:
    assert submitted("throw", "mujoco") >= LEAST["throw"]


def submitted(builder: str, *words: object) -> float:
    """The indicator of the only submission that counts, which must succeed."""
    words = [sys.executable, f"{builder}.py", *map(str, words)]
    done = subprocess.run(words, cwd=EXAMPLES, capture_output=True, text=True, check=True)
    *tests, last = done.stdout.splitlines()
    assert len(tests) == 3
    assert last.startswith("It succeeded.")
    return float(re.findall(r"[A-Z][a-z ]+: (\d+(?:\.\d+)?)", last)[0])
