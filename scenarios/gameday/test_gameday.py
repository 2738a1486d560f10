"""A small game day: three faults, their alerts, and the books."""

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from scenarios.gameday.faults import FAULTS
from scenarios.gameday.run import HOUR_MIN, day
from support.servers.prometheus import needs_alertmanager

pytestmark = pytest.mark.nightly

JOBS = 12
CHOSEN = {
    "the API is killed": 1.0,
    "the broker hangs": 2.0,
    "the store of artifacts takes nothing": 8.0,
}
"""When which fault begins, minutes of the plan."""
MINUTE_S = 8.0


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that Postgres can reach as another user."""
    with tempfile.TemporaryDirectory(prefix="buildarena-gameday-") as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_the_plan_is_an_hour_of_twelve_faults_whose_names_differ() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) == 12
    assert all(fault.at_min + fault.lasts_min < HOUR_MIN for fault in FAULTS)
    assert sum(fault.alert is not None for fault in FAULTS) >= 6


@needs_alertmanager
@pytest.mark.timeout(900)
def test_a_small_game_day(folder) -> None:
    faults = [replace(f, at_min=CHOSEN[f.name]) for f in FAULTS if f.name in CHOSEN]
    found = day(folder, jobs=JOBS, faults=faults, minute_s=MINUTE_S, waits=False)
    assert found["wrong"] == {}, found
    assert found["jobs_done"] == JOBS
    heard = {row["fault"]: row["heard_after_min"] for row in found["faults"]}
    assert heard["the API is killed"] is None
    assert heard["the broker hangs"] is not None
