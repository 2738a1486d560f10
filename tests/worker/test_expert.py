"""The built-in models: the expert succeeds, others fail, kept sessions replay, prompts suffice."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from support.documents.kept_sessions import (
    SCRIPTED,
    SESSIONS,
    described,
    digest_of,
    played_again,
    transcript_of,
)
from support.marks import nightly
from support.player import Played, Player
from support.providers.engineer import Engineer
from support.providers.flying_engineer import FlyingEngineer

from buildarena_backend.journal.journal import JournalEntry, Usage
from buildarena_benchmark import Task, builtin_tasks, score
from buildarena_simulation import ENGINES, simulate
from buildarena_worker.session.results import Failed

TASKS = sorted(builtin_tasks())
SEEDS = range(int(os.environ.get("EXPERT_SEEDS", "1")))
ON_PYBULLET = ["flight-1", "lift-3", "support-1", "transport-1", "mechanisms-2"]
"""One task of each category; PyBullet takes several times as long, the rest is nightly."""
TRIALS = [
    (task, engine) if engine == "mujoco" or task in ON_PYBULLET else nightly(task, engine)
    for task in TASKS
    if not builtin_tasks()[task].tests  # those are in test_identify.py
    for engine in ("pybullet", "mujoco")
]


def tried(play, model: str, task: str, seed: int, engine: str):
    """The score of a model's machine, or the failure that kept it from being tried."""
    played = play(model, task=task, seed=seed)
    if played.suspended is None:
        return played.failure
    machine = played.suspended.machine
    drawn = builtin_tasks()[task].drawn(seed)
    trajectory = simulate(machine, drawn.scenario, engine, controls=played.suspended.controls)
    return score(drawn, machine, trajectory)


@pytest.mark.nightly(keep=5)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("task", "engine"), TRIALS)
def test_the_expert_succeeds(play, task, seed, engine) -> None:
    result = tried(play, "builtin/expert", task, seed, engine)
    assert not isinstance(result, Failed), result
    assert result.success, result


def test_the_other_baselines_fail(play, subtests) -> None:
    for task in TASKS:
        for model in ("builtin/random", "builtin/idle"):
            with subtests.test(task=task, model=model):
                result = tried(play, model, task, 0, "mujoco")
                assert isinstance(result, Failed) or not result.success


def entry(data: dict[str, Any]) -> JournalEntry:
    usage = {**data["usage"], "cost_usd": Decimal(data["usage"]["cost_usd"])}
    return JournalEntry(**{**data, "usage": Usage(**usage)})


def test_a_kept_session_replays_to_the_same_bytes(play, subtests) -> None:
    for resumed in [False, True]:
        for name in SESSIONS:
            with subtests.test(resumed=resumed, name=name):
                kept = SESSIONS[name]
                entries = [entry(data) for data in kept["journal"]]
                # A resumed session has a model to ask, and asks it only for what the journal lacks.
                offline = not resumed
                cut = len(entries) // 2 if resumed and name != SCRIPTED else len(entries)
                played = played_again(play, kept, entries=entries[:cut], offline=offline)
                assert described(played.result) == kept["result"]
                assert [e.request_hash for e in played.entries[:cut]] == [
                    e.request_hash for e in entries[:cut]
                ]
                if resumed:
                    # Those that kept them kept no prompts.
                    assert [replace(entry, told=None) for entry in played.entries] == entries
                assert played.session.transcript.to_json() == transcript_of(kept)
                assert played.session.transcript.refusals == kept["refusals"]
                assert digest_of(played) == kept["machine"]


def test_the_kept_sessions_end_in_every_way() -> None:
    kinds = {kept["result"]["kind"] for kept in SESSIONS.values()}
    assert kinds == {"Finished", "Suspended", "Failed", "LimitReached"}


TASKS_FROM_PROMPTS = ["mechanisms-3", "mechanisms-4"]
OTHER_WINCHES = [(14, 7)]
"""Masses and distances of other cargoes."""


def built(task: Task, engineer: Engineer | None = None, **options: bool) -> Played:
    """A session of the stand-in, up to its first trial."""
    return Player()(task=task, client=engineer or Engineer(), workflow="builder", **options)


def first_try(task: Task, engine: str) -> bool:
    """Whether the first trial of a session succeeds."""
    played = built(task)
    assert played.suspended, played.failure
    controls = played.suspended.controls
    machine = played.suspended.machine
    return score(task, machine, simulate(machine, task.scenario, engine, controls=controls)).success


def another_winch(weight: float, north: float) -> Task:
    """The winch for another cargo, in words and in its trial."""
    task = builtin_tasks()["mechanisms-3"]
    statement, count = re.subn(r"weighs\s+20", f"weighs {weight}", task.statement)
    statement, moved = re.subn(r"\(0, 6, 0\)", f"(0, {north}, 0)", statement)
    assert (count, moved) == (1, 1)
    cargo = task.scenario.cargo.model_copy(
        update={"at": (0, north, 0), "initial_mass": weight, "final_mass": weight}
    )
    scenario = task.scenario.model_copy(update={"cargo": cargo})
    return replace(task, statement=statement, scenario=scenario)


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", TASKS_FROM_PROMPTS)
def test_numbers_in_the_prompt_are_enough_for_a_first_success(name, engine) -> None:
    assert first_try(builtin_tasks()[name], engine)


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("weight", "north"), OTHER_WINCHES)
def test_other_numbers_make_other_machines_that_succeed_too(weight, north, engine) -> None:
    assert first_try(another_winch(weight, north), engine)


def test_without_data_sheets_nobody_can_compute_it(subtests) -> None:
    for name in TASKS_FROM_PROMPTS:
        with subtests.test(name=name):
            played = built(builtin_tasks()[name], data_sheets=False)
            assert isinstance(played.result, LookupError)
            assert "does not say" in str(played.result)


def test_a_lighter_cargo_takes_fewer_motors() -> None:
    motors = [
        sum(block.module.name == "Cog Medium Powered" for block in machine.blocks.values())
        for machine in (built(another_winch(mass, 6)).suspended.machine for mass in (20, 14))
    ]
    assert motors == [4, 3]


@pytest.mark.ci
@pytest.mark.parametrize("engine", ENGINES)
def test_the_words_on_programs_are_enough_to_land_in_any_world(engine) -> None:
    task = builtin_tasks()["landing-1"]
    played = Player()(task=task, client=FlyingEngineer(), workflow="builder")
    assert played.suspended, played.failure
    assert played.suspended.controls is None
    machine = played.suspended.machine
    for seed in (None, 1, 2):
        trajectory = simulate(machine, task.scenario, engine, seed=seed)
        assert score(task, machine, trajectory).success, seed


def test_without_data_sheets_nobody_can_compute_how_to_fly() -> None:
    played = Player()(
        task="landing-1", client=FlyingEngineer(), workflow="builder", data_sheets=False
    )
    assert isinstance(played.result, LookupError)
    assert "does not say" in str(played.result)
