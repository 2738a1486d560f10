"""A runner of the game says that a program failed: its log shows it, or it is not believed."""

from dataclasses import replace

import pytest
from support.game.game_rig import GO, drive, piloted, program
from support.game.record_games import RUN, game_of, recorded
from support.machines.trials import press

from buildarena_backend.errors import UploadError
from buildarena_backend.trials.trial_checks import require_refusable
from buildarena_besiege.run import prepared_machine

pytestmark = pytest.mark.nightly

FAILS = program("return t < 1 and { spinning_forward = 0.3 } or sense.nothing.here")
"""It fails at 1 s."""
NAMED = {"run": RUN, "game": "1", "mod": "1"}


@pytest.fixture(scope="module")
def logs() -> dict[str, bytes]:
    """What the game prints of the car with a program, by the program."""
    scenario = drive()
    run = recorded(piloted(), scenario)
    games = {}
    for text in (FAILS, GO):
        prepared = prepared_machine(piloted(text), scenario, run_id=RUN)
        game = game_of(replace(run, prepared=prepared), scenario)
        games[text] = "\n".join(game.lines).encode()
    return games


def refusable(text: str, log: bytes | None, **more) -> None:
    """Whether a runner of the game is believed that a program failed."""
    machine = more.pop("machine", piloted(text))
    require_refusable(
        simulator="besiege",
        machine=machine,
        scenario=drive(),
        controls=more.pop("controls", None),
        versions={**NAMED, **more},
        log=log,
    )


FAILED = (
    "the controller failed, line 2, tick 25 (1.00 s): "
    "attempt to index field 'nothing' (a nil value)"
)


def test_a_program_that_failed_in_the_game_is_believed_by_its_log(logs) -> None:
    refusable(FAILS, logs[FAILS], refused=FAILED)


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("text", "log", "more", "words"),
    [
        (FAILS, None, {}, "does not refuse this machine"),
        (GO, GO, {}, "does not refuse this machine"),
        (GO, FAILS, {}, "another machine"),
        (FAILS, FAILS, {"refused": FAILED.replace("line 2", "line 3")}, "refused is not: the con"),
        (FAILS, FAILS, {"refused": None}, "refused is not: the controller failed, line 2"),
        (FAILS, FAILS, {"run": "another"}, "the log does not describe the trial"),
        (FAILS, FAILS, {"controls": [press("UpArrow", 0.5, 1.0)]}, "does not refuse this machine"),
    ],
)
def test_a_failure_that_the_log_does_not_tell_is_not_believed(logs, text, log, more, words) -> None:
    with pytest.raises(UploadError, match=words):
        refusable(text, logs.get(log), **{"refused": FAILED, **more})
