"""Texts for a builder: modules, world, and the trial afterwards."""

from dataclasses import replace

import pytest
from scipy.spatial.transform import Rotation
from support.machines.references import load_machine
from support.machines.trials import trial as trial_of

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.catalog.tracks import Track, has_data_sheets
from buildarena_benchmark import Score, builtin_tasks
from buildarena_benchmark.environment import Environment
from buildarena_benchmark.environment import briefing as words_around
from buildarena_benchmark.environment.briefing import briefing_digest
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_benchmark.environment.trials.world import world_text
from buildarena_benchmark.flags import meaning
from buildarena_benchmark.scores import explain
from buildarena_geometry import LOOKUP, module_set, modules_named, tool_definitions
from buildarena_geometry.feedback.words import plain
from buildarena_simulation import constants
from buildarena_simulation.constants import JOINT_STRENGTH, JointKind


def world(*names: str) -> str:
    return world_text(module_set("workshop"), names)


def test_the_world_is_told_from_the_constants(monkeypatch):
    text = world(*modules_named("workshop"))
    strengths = (JOINT_STRENGTH[JointKind.ATTACHMENT], JOINT_STRENGTH[JointKind.FAR_JOINT])
    names = ("GRAVITY", "ROPE_STRENGTH", "LOAD_FILTER_S", "BLOW_FILTER_S", "CARGO_BOUNCE")
    figures = [getattr(constants, name) for name in names]
    for figure in (*figures, *(f for joint in strengths for f in (joint.force, joint.moment))):
        assert plain(figure) in text
    monkeypatch.setattr(constants, "GRAVITY", 9.75)
    assert "Gravity is 9.75 units/s²" in world()
    orbit = builtin_tasks()["orbit-2"]
    modules = orbit.constraints.catalogue.with_data_sheets
    assert "Gravity is" not in world_text(modules, [], orbit), "the task states it"


def test_a_builder_is_told_how_many_of_a_module_it_may_have():
    for name, bound in (("throw-1", "Exactly 1 x Boulder."), ("mechanisms-7", "At least 1 x Cog")):
        assert bound in Environment(name).observation.briefing


def test_a_builder_is_told_numbers_unless_it_is_to_find_them_out():
    for name in builtin_tasks():
        complete = Environment(name).observation.briefing
        withheld = Environment(name, data_sheets=False).observation.briefing
        assert "A joint breaks at" in complete
        assert "axial 1, shear 0.32" in complete, "stiffness"
        assert plain(constants.GRAVITY) in complete
        assert "A joint breaks at" not in withheld
        assert "A force of 1" not in withheld
        assert withheld.splitlines()[:20] == complete.splitlines()[:20]


def test_told_and_withheld_are_tracks_of_their_own():
    digests = [briefing_digest("once", "guidelines", data_sheets=how) for how in (False, True)]
    assert digests[0] != digests[1]
    names = {"workflow": "a", "simulator": "mujoco", "simulation_version": "3", "prompts": "own"}
    tracks = [Track(**names, prompts_digest="0", data_sheets=how) for how in (False, True)]
    assert tracks[0].id != tracks[1].id
    configs = [track.as_config() for track in tracks]
    assert [has_data_sheets(config) for config in configs] == [False, True]
    # Tracks of before there were data sheets say nothing of them, and had none.
    assert "data_sheets" not in configs[0]
    assert SweepSpec(tasks=["lift-1"], models=["a"]).data_sheets


def test_other_words_around_a_statement_are_another_digest(monkeypatch):
    caches = (briefing_digest, words_around._text)
    digest, read = briefing_digest("once", "guidelines"), words_around.file_text
    digests = {digest}
    for file in ("briefing.md", "controller.md", "senses.json"):
        with monkeypatch.context() as patched:
            changed = lambda name, file=file: read(name) + "!" * (name == file)  # noqa: E731
            patched.setattr(words_around, "file_text", changed)
            for cached in caches:
                cached.cache_clear()
            digests.add(briefing_digest("once", "guidelines"))
    for cached in caches:
        cached.cache_clear()
    assert len(digests) == 4


LOOKUPS = {tool.name for tool in tool_definitions([LOOKUP])}


def task(**update):
    given = builtin_tasks()["support-1"]
    return replace(given, constraints=given.constraints.model_copy(update=update))


def test_a_builder_is_told_the_set_of_its_task():
    for modules, count in ((None, 6), ("workshop", 40)):
        observation = Environment(task(modules=modules)).observation
        listed = observation.briefing.partition("# Modules")[2].strip().splitlines()
        assert sum(line.startswith("- ") for line in listed) == count + 1
        assert not LOOKUPS & {tool.name for tool in observation.tools}


def test_a_builder_that_looks_up_reads_how_and_has_the_tools():
    environment = Environment(task(modules="workshop", module_list="on_demand"))
    observation = environment.observation
    assert {tool.name for tool in observation.tools} >= LOOKUPS
    assert "list_modules" in observation.briefing
    assert module_set("workshop")["Hinge"].description not in observation.briefing
    complete = Environment(task(modules="workshop")).observation
    assert len(observation.briefing) < 0.5 * len(complete.briefing)
    step = environment.step("describe_module", {"module": "Hinge"})
    assert module_set("workshop")["Hinge"].description in step.feedback


FAILED = Score(success=False, indicator=0.25, metrics={}, flags=())


def test_every_scorer_says_what_happened_whatever_it_could_measure():
    for given in builtin_tasks().values():
        for found in (FAILED, replace(FAILED, indicator=0.0)):
            text = score_text(given, found)
            assert explain(given, found) in text
            assert explain(given, found).endswith(".")
            assert ": 0.25 1." not in text, "a ratio has no unit"


@pytest.mark.parametrize(
    ("name", "metrics", "says"),
    [
        (
            "orbit-2",
            {"cycles": 1.0, "completed_s": 29.4, "landed": True},
            "It flew round in 29.4 s, but had not landed for long enough at 120 s.",
        ),
        (
            "transport-4",
            {"stops": 3, "largest_distance_to_mark": 1.4},
            "It made all 3 stops, the farthest 1.40 away; 1 is allowed.",
        ),
        (
            "budget-1",
            {"load_when_decided": 300.0, "fall_time_s": None, "collapse_time_s": None},
            "The cargo stayed up to the end, with a load of 300.",
        ),
        (
            "place-2",
            {
                "distance_to_mark": 0.3,
                "loose_way": 0.2,
                "base_shift": 0.7,
                "carried": True,
                "broken_joints": 0,
            },
            "The cargo ended 0.30 from its mark, but the base moved by 0.70; 0.5 is allowed.",
        ),
        ("landing-2", {"landed": True}, "It landed less than 3 s before the end of the trial."),
        (
            "support-1",
            {"load_when_decided": 20.0, "time_above_s": 1.2, "collapse_time_s": 1.2},
            "The bridge broke after 1.2 s, at a load of 20 of 1,500; it must hold for 2 s.",
        ),
        (
            "throw-4",
            {"flew": True, "distance": 20.0, "rings": 0},
            "The boulder passed no ring and came down 20.0 beyond the line.",
        ),
        (
            "mechanisms-7",
            {"max_height": 6.7},
            "The cargo rose by 6.7; 5 is asked, in a lift by all rules.",
        ),
        (
            "throw-1",
            {"flew": True, "distance": 53.8},
            "The boulder came down 53.8 beyond the line.",
        ),
        ("balance-2", {"balanced_s": 0.0}, "It balanced by all rules for 0.0 s; 20 s is asked."),
    ],
)
def test_a_failure_names_the_figure_that_decided(name, metrics, says) -> None:
    assert explain(builtin_tasks()[name], replace(FAILED, metrics=metrics)) == says


def test_a_trial_that_blew_up_is_told_by_its_flag_whatever_its_metrics_are():
    figures = dict.fromkeys(("distance", "rms_acceleration", "rise", "landed", "way", "touched"))
    blown = replace(FAILED, metrics=figures, flags=("unstable",))
    for given in builtin_tasks().values():
        assert explain(given, blown) == meaning("unstable")


def test_a_success_that_a_flag_disqualifies_is_none():
    flagged = replace(FAILED, success=True, flags=("start_too_high",))
    text = score_text(builtin_tasks()["lift-2"], flagged)
    assert text.startswith("It did not succeed.")
    assert meaning("start_too_high") in text


def test_toppling_is_told_from_the_starting_blocks_lean():
    given = builtin_tasks()["transport-1"]
    result, path = trial_of(given, load_machine("car-without-keys"), "mujoco", duration_s=1.0)
    for degrees, axis, topples in ((59, "y", False), (61, "y", True), (61, "z", False)):
        lean = Rotation.from_euler(axis, degrees, degrees=True).as_quat()[[3, 0, 1, 2]]
        turned = path.quaternions.copy()
        turned[:10, 0], turned[10:, 0] = (1, 0, 0, 0), lean
        text = score_text(given, result, replace(path, quaternions=turned))
        assert (f"from {path.time_s[10]:.2f} s on" in text) == topples
        assert ("It toppled" in text) == (f"by {degrees}°" in text) == topples


def test_the_first_break_is_told():
    given = builtin_tasks()["support-1"]
    result, path = trial_of(given, load_machine("beam"), "mujoco", duration_s=3.0)
    assert f"First to break: {path.breaks[0].joint}" in score_text(given, result, path)
    assert "First to break" not in score_text(given, result)
