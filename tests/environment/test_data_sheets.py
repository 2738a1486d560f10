"""The numbers of modules and world: told, or left to trials, and never compared."""

from __future__ import annotations

import pytest

from buildarena_benchmark import builtin_tasks
from buildarena_environment import Environment
from buildarena_environment import briefing as words_around
from buildarena_environment.briefing import briefing_digest
from buildarena_environment.world import world_text
from buildarena_geometry import module_set, modules_named
from buildarena_geometry.feedback.words import plain
from buildarena_pipeline.catalog.prompt_packs import PromptPacks
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_pipeline.catalog.tracks import external_track, has_data_sheets, make_track
from buildarena_pipeline.catalog.workflows import workflow_sources
from buildarena_simulation import constants
from buildarena_simulation.constants import JOINT_STRENGTH, JointKind


def world(*names: str) -> str:
    return world_text(module_set("workshop"), names)


def test_the_world_is_told_from_the_constants(monkeypatch):
    text = world(*modules_named("workshop"))
    joint, far = JOINT_STRENGTH[JointKind.ATTACHMENT], JOINT_STRENGTH[JointKind.FAR_JOINT]
    for figure in (
        constants.GRAVITY,
        joint.force,
        joint.moment,
        far.force,
        far.moment,
        constants.ROPE_STRENGTH,
        constants.LOAD_FILTER_S,
        constants.BLOW_FILTER_S,
        constants.CARGO_BOUNCE,
    ):
        assert plain(figure) in text
    monkeypatch.setattr(constants, "GRAVITY", 9.75)
    assert "Gravity is 9.75 units/s²" in world()


def test_on_a_planet_gravity_is_the_tasks_to_tell():
    task = builtin_tasks()["orbit-1"]
    names = modules_named(task.constraints.modules)
    text = world_text(task.constraints.catalogue.with_data_sheets(), names, task)
    assert "Gravity is" not in text
    assert "Gravity and air are the planet's" in text
    assert "pull on\nthe ground, from 21 to 25" in task.statement


@pytest.mark.parametrize("kind", [k for k in JointKind if k not in ("far_joint", "mount")])
def test_one_strength_is_told_because_all_joints_have_it(kind):
    attachment = JOINT_STRENGTH[JointKind.ATTACHMENT]
    strength = JOINT_STRENGTH[kind]
    assert (strength.force, strength.moment) == (attachment.force, attachment.moment)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["Cog Large Unpowered"], ["pitch radii", "locks it"]),
        (["Winch"], ["rope", "Connectors"]),
        (["Brace"], ["so does a brace", "Connectors"]),
        (["Small Wooden Block"], ["far end joins"]),
        (["Wing Panel"], ["Air figures"]),
        (["Hinge"], ["locks it", "a joint that moves"]),
        ([], []),
    ],
)
def test_the_world_is_told_as_far_as_the_modules_go(names, told):
    text = world(*names)
    every = {"pitch radii", "locks it", "rope", "Connectors", "so does a brace", "far end joins"}
    every |= {"Air figures", "a joint that moves"}
    for words in every:
        known = words in told or (words == "a joint that moves" and "locks it" in told)
        assert (words in text) == known, words


@pytest.mark.parametrize("task", sorted(builtin_tasks()))
def test_a_builder_is_told_numbers_unless_it_is_to_find_them_out(task):
    told = Environment(task).observation.briefing
    withheld = Environment(task, data_sheets=False).observation.briefing
    assert "  Data: " in told
    assert plain(constants.GRAVITY) in told
    assert "  Data: " not in withheld
    assert "Gravity" not in withheld
    assert withheld.splitlines()[:20] == told.splitlines()[:20]


def test_told_and_withheld_are_tracks_of_their_own():
    digests = [briefing_digest("once", "guidelines", data_sheets=how) for how in (False, True)]
    assert digests[0] != digests[1]
    pack = PromptPacks().load("default")
    source = workflow_sources({})["five-role"]
    tracks = [external_track("mujoco", "3", digests[h], data_sheets=bool(h)) for h in (0, 1)]
    tracks += [make_track(source, "mujoco", pack, version="3", data_sheets=bool(h)) for h in (0, 1)]
    assert len({track.id for track in tracks}) == 4
    configs = [track.as_config() for track in tracks]
    assert [has_data_sheets(config) for config in configs] == [False, True, False, True]
    # Tracks of before there were data sheets say nothing of them, and had none.
    assert "data_sheets" not in configs[0]
    assert SweepSpec(tasks=["lift-1"], models=["a"]).data_sheets


@pytest.mark.parametrize("file", ["briefing.md", "controller.md", "senses.json"])
def test_other_words_around_a_statement_are_another_digest(monkeypatch, file):
    caches = (briefing_digest, words_around._text)
    digest, read = briefing_digest("once", "guidelines"), words_around.file_text
    monkeypatch.setattr(words_around, "file_text", lambda name: read(name) + "!" * (name == file))
    for cached in caches:
        cached.cache_clear()
    assert briefing_digest("once", "guidelines") != digest
    for cached in caches:
        cached.cache_clear()
