"""The golden logs are those of today's tasks, machines and scripts."""

import zipfile

from support.game.game_rig import GAMES
from support.game.record_games import Recorded, log_lines, played_runs, recorded

from buildarena_besiege.run import prepared_machine

RUNS = played_runs()


def test_each_run_that_is_played_was_recorded(subtests) -> None:
    """A script's begin line holds the digest of machine and scenario."""
    for name in RUNS:
        with subtests.test(name=name):
            begin = next(iter(lines_of(name))).removeprefix("b,")
            assert f'local begin = "{begin}"' in prepared_machine(*RUNS[name], run_id="x").script


def test_a_recording_is_what_the_engine_says() -> None:
    machine, scenario = RUNS["calibration"]
    again: Recorded = recorded(machine, scenario)
    assert list(log_lines(again, scenario)) == lines_of("calibration")


def lines_of(name: str) -> list[str]:
    with zipfile.ZipFile(GAMES) as archive:
        return archive.read(f"{name}.log").decode().splitlines()
