"""Prometheus' own checks, from Debian's package."""

import shutil
import subprocess

import pytest

PROMTOOL = shutil.which("promtool")

needs_promtool = pytest.mark.skipif(
    PROMTOOL is None, reason="rules need promtool: install the Debian packages prometheus"
)


def promtool(*words: str) -> str:
    """What a check printed; a failed one fails the test."""
    done = subprocess.run(
        [str(PROMTOOL), *words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr
