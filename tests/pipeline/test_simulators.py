from __future__ import annotations

import pytest

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.simulators import (
    BESIEGE,
    ENGINE_SIMULATORS,
    simulation_version,
    simulator_issues,
)
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.errors import SubmissionError
from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.settings import Settings
from buildarena_pipeline.submission.submission import Submissions

JOB = JobSpec(task="support-1", model="builtin/idle", simulator=BESIEGE)


@pytest.fixture
def with_game(context):
    own = open_context(
        context.settings.model_copy(update={"besiege_game": "1.75-23370", "besiege_mod": "1.4"})
    )
    yield Submissions(own, load_registry())
    own.close()


def test_a_job_for_the_game_is_refused_where_nobody_plays_it(submissions) -> None:
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_job(JOB)
    (issue,) = caught.value.issues
    assert issue.path == "simulator"
    assert "BUILDARENA_BESIEGE_GAME" in issue.message
    assert set(issue.choices) == set(ENGINE_SIMULATORS)


def test_a_job_for_the_game_has_the_games_track(with_game) -> None:
    job, _ = with_game.submit_job(JOB)
    assert "/besiege-1.75-23370-1.4/" in job.track
    assert job.track_config["simulator"] == BESIEGE
    assert job.track_config["simulation_version"] == "1.75-23370-1.4"


def test_the_game_and_our_engines_never_share_a_track(with_game) -> None:
    tracks = {
        with_game.submit_job(JOB.model_copy(update={"simulator": name}))[0].track
        for name in (BESIEGE, *ENGINE_SIMULATORS)
    }
    assert len(tracks) == 1 + len(ENGINE_SIMULATORS)


def test_an_unknown_simulator_is_told_of_the_game_only_where_there_is_one() -> None:
    (without,) = simulator_issues("besiegee", None)
    (with_it,) = simulator_issues("besiegee", "1-1")
    assert BESIEGE not in without.choices
    assert BESIEGE in with_it.choices


def test_no_version_is_made_up_for_a_game_that_is_not_there() -> None:
    with pytest.raises(ValueError, match="no game"):
        simulation_version(BESIEGE, None)


@pytest.mark.parametrize(("game", "mod"), [("1.75", ""), ("", "1.4"), ("", "")])
def test_half_a_version_is_none(game, mod) -> None:
    assert Settings(besiege_game=game, besiege_mod=mod).besiege_version is None


@pytest.mark.parametrize("bad", ["1.75/2", "1 75", "x" * 41, "1.75\n"])
def test_a_version_that_would_spoil_a_tracks_name_is_refused(bad) -> None:
    with pytest.raises(ValueError, match="besiege_game"):
        Settings(besiege_game=bad, besiege_mod="1")
