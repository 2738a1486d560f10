"""Simulators: which there are, who may announce one, and that they never share a track."""

from importlib.metadata import EntryPoint

import pytest
from support.jobs import report_worker
from support.servers.live_api import changed

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.errors import StartupError, SubmissionError
from buildarena_backend.settings import Settings
from buildarena_backend.states import simulate_queue
from buildarena_backend.submission.submission import Submissions
from buildarena_backend.trials import installed_simulators as installed
from buildarena_backend.trials.installed_simulators import installed_simulators
from buildarena_backend.trials.known_simulators import (
    find_simulator,
    known_simulators,
    simulation_version,
    simulator_issues,
)
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_simulation import DEFAULT_ENGINE, ENGINES, SIMULATION_VERSION, rollout

KNOWN = "buildarena_backend.trials.known_simulators.ENGINES"
ENGINE = "buildarena_simworker.engines:engine_simulator"


def job(simulator: str) -> JobSpec:
    return JobSpec(task="support-1", model="builtin/idle", simulator=simulator)


def announce(context, name: str, **versions: object) -> None:
    report_worker(context, f"simulate@{name}:1", simulate_queue(name), versions=versions)


def issue_of(submissions: Submissions, spec: JobSpec):
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_job(spec)
    (issue,) = caught.value.issues
    return issue


def test_a_job_for_the_game_is_taken_where_it_is_played_in_its_own_track(
    context, submissions
) -> None:
    issue = issue_of(submissions, job(BESIEGE))
    assert (issue.path, set(issue.choices)) == ("simulator", set(ENGINES))
    assert "BUILDARENA_BESIEGE_GAME" in issue.message
    with pytest.raises(ValueError, match="no game"):
        simulation_version(context, BESIEGE)
    with changed(context, besiege_game="1.75-23370", besiege_mod="1.4") as own:
        with_game = Submissions(own, load_registry())
        made, _ = with_game.submit_job(job(BESIEGE))
        assert "/besiege-1.75-23370-1.4/" in made.track
        assert made.track_config["simulation_version"] == "1.75-23370-1.4"
        tracks = {made.track, *(with_game.submit_job(job(name))[0].track for name in ENGINES)}
        assert len(tracks) == 1 + len(ENGINES)
        for each, known in ((own, True), (context, False)):
            (issue,) = simulator_issues(each, "besiegee")
            assert (BESIEGE in issue.choices) == known


def test_a_default_engine_that_is_missing_is_refused_not_replaced(submissions, monkeypatch) -> None:
    spec = JobSpec(task="support-1", model="builtin/idle")
    made, _ = submissions.submit_job(spec)
    assert made.track_config["simulator"] == DEFAULT_ENGINE == "pybullet"
    with monkeypatch.context() as patch:
        patch.setattr(rollout, "ENGINES", ("mujoco",))
        patch.setattr(KNOWN, ("mujoco",))
        issue = issue_of(submissions, spec)
        assert "pip install pybullet" in issue.message
        assert issue.choices == ("mujoco",)
    monkeypatch.setattr(KNOWN, ())  # a service that has none takes jobs for all of ours
    for name in ENGINES:
        made, _ = submissions.submit_job(job(name))
        assert made.track_config["simulation_version"] == SIMULATION_VERSION


def test_what_a_worker_announces_can_be_named_and_changes_nothing_known(
    context, submissions
) -> None:
    assert "unknown simulator 'unity'" in issue_of(submissions, job("unity")).message
    announce(context, "mujoco", simulation="99", kind="game", deterministic=False)
    announce(context, "a/b", simulation="1")
    announce(context, "spaced", simulation="1 2")
    announce(context, "silent")
    assert list(known_simulators(context)) == list(ENGINES)
    assert find_simulator(context, "mujoco").kind == "engine"
    announce(context, "unity", simulation="7.1", kind="game", deterministic=False)
    assert "/unity-7.1/" in submissions.submit_job(job("unity"))[0].track
    found = find_simulator(context, "unity")
    assert (found.kind, found.deterministic, found.version) == ("game", False, "7.1")
    with changed(context, extra_simulators={"godot": "4"}) as own:  # it has no worker yet
        assert simulation_version(own, "godot") == "4"


def test_versions_that_would_spoil_a_tracks_name_are_refused() -> None:
    for bad in ("1.75/2", "1 75", "x" * 41, "1.75\n"):
        with pytest.raises(ValueError, match="besiege_game"):
            Settings(besiege_game=bad, besiege_mod="1")
    for game, mod in (("1.75", ""), ("", "1.4")):
        assert Settings(besiege_game=game, besiege_mod=mod).besiege_version is None
    with pytest.raises(ValueError, match="extra_simulators"):
        Settings(extra_simulators={"unity/1": "7"})


def test_what_is_installed_comes_from_entry_points_and_wrong_ones_are_named(monkeypatch) -> None:
    found = installed_simulators()
    kinds = {name: each.kind for name, each in found.items()}
    assert kinds == {**dict.fromkeys(ENGINES, "engine"), BESIEGE: "game"}
    assert (found[BESIEGE].single, found[BESIEGE].deterministic) == (True, False)

    def registered(*given: tuple[str, str]) -> None:
        points = [EntryPoint(*each, "x") for each in given]
        monkeypatch.setattr(installed, "entry_points", lambda **_: points)

    for given, says in [
        ([("mujoco", ENGINE), ("mujoco", ENGINE)], "two distributions register .* 'mujoco'"),
        ([("unity", "no_such_package:x")], r"'unity' \(no_such_package:x\) can't be loaded"),
    ]:
        registered(*given)
        with pytest.raises(StartupError, match=says):
            installed_simulators()
    registered(("unity", ENGINE))
    assert not installed_simulators(), "an engine that is not installed is not there"
