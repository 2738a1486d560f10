"""Whether growth is told from noise."""

import math
import os

import psutil
import pytest
from scenarios.soak.memory import Watch, growth
from support.servers.stacks import wait_until


def samples(slope_per_min: float, noise: float) -> list[tuple[float, float]]:
    return [(5.0 * n, 100 + slope_per_min * n / 12 + noise * math.sin(7.3 * n)) for n in range(720)]


@pytest.mark.parametrize(
    ("slope", "noise", "grows"),
    [
        (0.0, 0.0, False),
        (0.0, 10.0, False),
        (0.05, 0.0, False),
        (0.5, 0.5, True),
        (-1.0, 0.5, False),
    ],
)
def test_growth_is_told_from_noise(slope, noise, grows) -> None:
    found = growth(samples(slope, noise))
    assert found.grows is grows
    assert found.growth_mib == pytest.approx(slope * 30, abs=0.5 + noise / 10)
    assert found.minutes == pytest.approx(30, abs=0.2)


def test_processes_are_watched() -> None:
    with Watch(lambda: {"this": psutil.Process(os.getpid())}, every_s=0.01) as watch:
        wait_until(lambda: len(watch.samples["this"]) > 3, 5, "a few samples")
    assert all(size > 1 for _, size in watch.samples["this"])
