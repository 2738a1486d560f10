"""The attack at a small size; `make scenario NAME=attack` does it at full size."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from scenarios.attack.arena import Arena, arena
from scenarios.attack.run import small_disk
from scenarios.attack.scenarios import SCENARIOS
from support.marks import nightly

pytestmark = pytest.mark.nightly

SMALL = {
    "jobs": 60,
    "streams": 60,
    "exports": 12,
    "boards": 20,
    "verifications": 60,
    "half requests": 1500,
    "flood_s": 1.0,
    "bomb_mib": 64,
    "lies": 3,
    "heartbeats": 8,
    "kills": 2,
    "strangers": 60,
    "broker_s": 3,
}
QUICK = {"tenants", "truncated bodies", "harmful runner", "strangers", "look-alikes", "boards"}
"""What takes seconds; the others are left to `make test-nightly`."""


@pytest.fixture(scope="module")
def place() -> Iterator[Arena]:
    # Postgres must reach it as another user: a folder of pytest's is closed to others.
    with (
        tempfile.TemporaryDirectory(prefix="buildarena-attack-") as name,
        small_disk(Path(name) / "disk") as disk,
        arena(Path(name), SMALL, artifacts_url=str(disk)) as found,
    ):
        yield found


@pytest.mark.timeout(180)
@pytest.mark.parametrize(
    "name",
    [
        nightly(name)
        if name.startswith("killed")
        else pytest.param(name, marks=() if name in QUICK else pytest.mark.ci)
        for name in SCENARIOS
    ],
)
def test_nothing_goes_wrong(place, name) -> None:
    place.victim.take()
    tried = SCENARIOS[name](place)
    place.victim.wait_for_an_answer(30)
    _, asked, failed = place.victim.take()
    assert tried.wrong == [], tried
    assert asked > 0
    assert failed == 0
