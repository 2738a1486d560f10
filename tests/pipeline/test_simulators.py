from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.errors import StartupError, SubmissionError
from buildarena_pipeline.runtime.context import open_context
from buildarena_pipeline.runtime.settings import Settings
from buildarena_pipeline.runtime.simulators import installed
from buildarena_pipeline.runtime.simulators.installed import installed_simulators
from buildarena_pipeline.runtime.simulators.known import (
    find_simulator,
    known_simulators,
    simulation_version,
    simulator_issues,
)
from buildarena_pipeline.runtime.simulators.simulator import BESIEGE
from buildarena_pipeline.submission.submission import Submissions
from buildarena_simulation import (
    ALL_ENGINES,
    DEFAULT_ENGINE,
    ENGINES,
    SIMULATION_VERSION,
    rollout,
)
from buildarena_store.states import simulate_queue

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
    assert set(issue.choices) == set(ENGINES)


def test_a_job_for_the_game_has_the_games_track(with_game) -> None:
    job, _ = with_game.submit_job(JOB)
    assert "/besiege-1.75-23370-1.4/" in job.track
    assert job.track_config["simulator"] == BESIEGE
    assert job.track_config["simulation_version"] == "1.75-23370-1.4"


def test_the_game_and_our_engines_never_share_a_track(with_game) -> None:
    tracks = {
        with_game.submit_job(JOB.model_copy(update={"simulator": name}))[0].track
        for name in (BESIEGE, *ENGINES)
    }
    assert len(tracks) == 1 + len(ENGINES)


def test_a_job_without_a_simulator_is_for_the_default_engine(submissions) -> None:
    job, _ = submissions.submit_job(JobSpec(task="support-1", model="builtin/idle"))
    assert job.track_config["simulator"] == DEFAULT_ENGINE == "pybullet"


def test_where_the_default_engine_is_missing_it_is_refused_and_never_replaced(
    submissions, monkeypatch
) -> None:
    monkeypatch.setattr(rollout, "ENGINES", ("mujoco",))
    monkeypatch.setattr("buildarena_pipeline.runtime.simulators.known.ENGINES", ("mujoco",))
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_job(JobSpec(task="support-1", model="builtin/idle"))
    (issue,) = caught.value.issues
    assert "pip install pybullet" in issue.message
    assert issue.choices == ("mujoco",)


def test_a_service_that_has_no_engine_takes_jobs_for_all_of_ours(submissions, monkeypatch) -> None:
    monkeypatch.setattr("buildarena_pipeline.runtime.simulators.known.ENGINES", ())
    for name in ALL_ENGINES:
        job, _ = submissions.submit_job(JOB.model_copy(update={"simulator": name}))
        assert job.track_config["simulation_version"] == SIMULATION_VERSION


def test_an_unknown_simulator_is_told_of_the_game_only_where_there_is_one(
    context, with_game
) -> None:
    (without,) = simulator_issues(context, "besiegee")
    (with_it,) = simulator_issues(with_game._context, "besiegee")
    assert BESIEGE not in without.choices
    assert BESIEGE in with_it.choices


def test_no_version_is_made_up_for_a_game_that_is_not_there(context) -> None:
    with pytest.raises(ValueError, match="no game"):
        simulation_version(context, BESIEGE)


def test_a_simulator_that_a_worker_announces_can_be_named(context, submissions) -> None:
    unity = JOB.model_copy(update={"simulator": "unity"})
    with pytest.raises(SubmissionError, match="there is no simulator 'unity'"):
        submissions.submit_job(unity)
    announce(context, "unity", simulation="7.1", kind="game", repeatable=False)
    job, _ = submissions.submit_job(unity)
    assert "/unity-7.1/" in job.track
    found = find_simulator(context, "unity")
    assert (found.kind, found.repeatable, found.version) == ("game", False, "7.1")
    assert list(known_simulators(context)) == [*ENGINES, "unity"]


def test_what_a_worker_says_changes_nothing_of_what_the_service_knows(context) -> None:
    announce(context, "mujoco", simulation="99", kind="game", repeatable=False)
    announce(context, "a/b", simulation="1")
    announce(context, "spaced", simulation="1 2")
    announce(context, "silent")
    assert list(known_simulators(context)) == list(ENGINES)
    assert find_simulator(context, "mujoco").kind == "engine"


def test_an_operator_can_name_a_simulator_that_has_no_worker_yet(context) -> None:
    settings = context.settings.model_copy(update={"further_simulators": {"unity": "7.1"}})
    own = open_context(settings)
    assert simulation_version(own, "unity") == "7.1"
    own.close()
    with pytest.raises(ValueError, match="further_simulators"):
        Settings(further_simulators={"unity/1": "7"})


def test_what_is_installed_comes_from_entry_points() -> None:
    found = installed_simulators()
    assert list(found) == [*ENGINES, BESIEGE]
    assert [found[name].kind for name in found] == ["engine", "engine", "game"]
    assert found[BESIEGE].single
    assert not found[BESIEGE].repeatable
    assert found[BESIEGE].version(Settings()) is None


class Registered:
    """Entry points as a further distribution would add them."""

    def __init__(self, *given: tuple[str, str]) -> None:
        self.given = given

    def __call__(self, *, group: str) -> list[EntryPoint]:
        return [EntryPoint(name, value, group) for name, value in self.given]


ENGINE = "buildarena_simworker.registered:engine_simulator"


def test_a_distribution_that_registers_wrongly_is_named(monkeypatch, subtests) -> None:
    for given, says in [
        ([("mujoco", ENGINE), ("mujoco", ENGINE)], "two distributions register .* 'mujoco'"),
        ([("unity", "no_such_package:x")], r"'unity' \(no_such_package:x\) can't be loaded"),
    ]:
        with subtests.test(given=given):
            monkeypatch.setattr(installed, "entry_points", Registered(*given))
            with pytest.raises(StartupError, match=says):
                installed_simulators()


def test_an_engine_that_is_not_installed_counts_as_not_there(monkeypatch) -> None:
    monkeypatch.setattr(installed, "entry_points", Registered(("unity", ENGINE)))
    assert not installed_simulators()


def announce(context, name: str, **versions: object) -> None:
    context.store.workers.report(
        worker_id=f"simulate@{name}:1",
        kind="simulate",
        queues=[simulate_queue(name)],
        host=name,
        pid=1,
        versions=versions,
    )


def test_half_a_version_is_none(subtests) -> None:
    for game, mod in [("1.75", ""), ("", "1.4"), ("", "")]:
        with subtests.test(game=game):
            assert Settings(besiege_game=game, besiege_mod=mod).besiege_version is None


def test_a_version_that_would_spoil_a_tracks_name_is_refused(subtests) -> None:
    for bad in ["1.75/2", "1 75", "x" * 41, "1.75\n"]:
        with subtests.test(bad=bad), pytest.raises(ValueError, match="besiege_game"):
            Settings(besiege_game=bad, besiege_mod="1")
