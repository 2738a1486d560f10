"""Machines that cannot be simulated, and names that do not exist."""

import dataclasses
import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest
from support.machines.drafts import KeyedDraft
from support.machines.families import beam, rocket

from buildarena_benchmark import failed_score, score
from buildarena_geometry import DocumentError, Machine
from buildarena_simulation import (
    MachineNotSimulable,
    UnknownEngineError,
    read_trajectory,
    rollout,
    simulate,
    write_trajectory,
)
from buildarena_simulation.constants import MAX_PARTS
from buildarena_simulation.engines.base import Engine, World
from buildarena_simulation.engines.registry import create_engine
from buildarena_simulation.structure.motion import Motion
from buildarena_worker.builtin.designs.drafting import EAST


def test_an_empty_machine_is_no_machine(engine, tasks) -> None:
    with pytest.raises(MachineNotSimulable, match="no blocks"):
        simulate(Machine(), tasks["lift-1"].scenario, engine)
    result = failed_score(tasks["lift-1"], Machine())
    assert (result.success, result.indicator) == (False, 0.0)


def test_a_machine_of_ten_thousand_blocks_is_refused_at_once(engine, tasks) -> None:
    draft = KeyedDraft()
    draft.start()

    # Building one block by block would take long: this one only says that it is large.
    crowd = SimpleNamespace(blocks=draft.machine.blocks, part_count=10_000)
    with pytest.raises(MachineNotSimulable, match=str(MAX_PARTS)):
        simulate(crowd, tasks["lift-1"].scenario, engine)


def test_an_unknown_engine_is_named_with_the_known_ones(tasks) -> None:
    with pytest.raises(UnknownEngineError, match="pybullet, mujoco"):
        simulate(beam(3), tasks["lift-1"].scenario, "havok")


def test_a_machine_in_two_halves_is_simulated_as_two(engine, tasks) -> None:
    draft = KeyedDraft()
    far = draft.row(draft.start(), EAST, 3)
    draft.do("remove_block", block_id=far[0])
    assert draft.machine.detached
    task = tasks["support-1"]
    scenario = task.scenario.model_copy(update={"duration_s": 3.0})
    trajectory = simulate(draft.machine, scenario, engine)
    assert not score(task, draft.machine, trajectory).success


def _document_with(change: str) -> str:
    text = json.dumps(beam(3).to_document())
    assert "Small Wooden Block" in text
    return text.replace("Small Wooden Block", change)


def test_a_document_with_an_unknown_module_never_reaches_the_simulator() -> None:
    with pytest.raises(DocumentError, match="Small Stone Block"):
        Machine.from_document(json.loads(_document_with("Small Stone Block")))


def test_a_scenario_that_tracks_a_missing_block_says_so(tasks) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"tracked_blocks": ("1", "77")})
    with pytest.raises(MachineNotSimulable, match="77"):
        simulate(beam(3), scenario, "mujoco")


def test_the_process_goes_on_after_a_failed_trial(engine, tasks) -> None:
    scenario = tasks["lift-1"].scenario.model_copy(update={"duration_s": 0.2})
    with pytest.raises(MachineNotSimulable):
        simulate(Machine(), scenario, engine)
    assert simulate(beam(3), scenario, engine).time_s[-1] == pytest.approx(0.2)


def test_a_rollout_that_blows_up_is_reported_and_never_a_success(
    engine, tasks, monkeypatch
) -> None:
    def fragile(name: str, world: World) -> Engine:
        made = create_engine(name, world)
        motion, calls = made.motion, itertools.count()

        def lost() -> Motion:
            now = motion()
            gone = next(calls) > 10
            return dataclasses.replace(now, position=now.position + (np.nan if gone else 0.0))

        monkeypatch.setattr(made, "motion", lost)
        return made

    monkeypatch.setattr(rollout, "create_engine", fragile)
    task = tasks["lift-1"]
    scenario = task.scenario.model_copy(update={"duration_s": 2.0})
    machine = rocket()
    trajectory = simulate(machine, scenario, engine)
    assert np.isfinite(trajectory.positions[:10]).all()
    assert not np.isfinite(trajectory.positions[-1]).any()
    result = score(task, machine, read_trajectory(write_trajectory(trajectory)))
    assert not result.success
    assert "unstable" in result.flags
    assert all(value == value for value in result.metrics.values())  # noqa: PLR0124 - no NaN
