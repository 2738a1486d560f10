"""Environments of tasks that name a module set, and whose modules are told or looked up."""

from __future__ import annotations

from dataclasses import replace

import pytest

from buildarena_benchmark import builtin_tasks
from buildarena_environment import Environment
from buildarena_environment.briefing import briefing_digest
from buildarena_geometry import LOOKUP, module_set, tool_definitions
from buildarena_pipeline.catalog.prompt_packs import PromptPacks
from buildarena_pipeline.catalog.tracks import external_track, make_track
from buildarena_pipeline.catalog.workflows import workflow_sources

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
    told = Environment(task(modules="workshop")).observation
    assert len(observation.briefing) < 0.5 * len(told.briefing)
    step = environment.step("describe_module", {"module": "Hinge"})
    assert module_set("workshop")["Hinge"].description in step.feedback


@pytest.mark.parametrize("name", sorted([*LOOKUPS, "List_Modules", " describe_module "]))
def test_where_modules_are_told_they_cannot_be_looked_up(name):
    environment = Environment(task(modules="workshop"))
    step = environment.step(name, {"category": "basic", "module": "Hinge"})
    assert not step.ok
    assert "Hinge" not in step.feedback


def test_a_state_goes_on_with_what_its_task_offers():
    environment = Environment(task(modules="workshop"))
    environment.step("start", {})
    document = environment.state().as_document()
    other = Environment(task(modules="workshop"))
    other.restore(document)
    attach = {"base_block": "1", "face": "A", "new_block": "Hinge"}
    assert other.step("attach_block_to", attach).ok
    plain = Environment(task())
    plain.step("start", {})
    assert not plain.step("attach_block_to", attach).ok


def test_told_and_looked_up_are_tracks_of_their_own():
    digests = [briefing_digest("once", "guidelines", on_demand=how) for how in (False, True)]
    assert digests[0] != digests[1]
    tracks = [external_track("mujoco", "3", digests[how], on_demand=how) for how in (False, True)]
    pack = PromptPacks().load("default")
    source = workflow_sources({})["builder"]
    tracks += [
        make_track(source, "mujoco", pack, version="3", on_demand=how) for how in (False, True)
    ]
    assert len({track.id for track in tracks}) == 4
    assert ["looked_up" in track.as_config() for track in tracks] == [False, True, False, True]
