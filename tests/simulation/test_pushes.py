"""Pushes that everything gets alike, machines that start tilted, and axes that are sensed alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.drafts import KeyedDraft
from support.machines.families import beam

from buildarena_simulation import Scenario, simulate
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import start_of
from buildarena_worker.builtin.designs.drafting import EAST, NORTH, UP

FALL = {"kind": "released", "height": 500}
PUSHES = [{"at_s": 0.4, "velocity": [1.2, 0]}, {"at_s": 1.013, "velocity": [-0.5, 2]}]


def scenario(**fields: Any) -> Scenario:
    return Scenario.model_validate({"duration_s": 2, **fields})


def test_a_push_changes_the_velocity_of_what_falls_and_strains_nothing(engine) -> None:
    calm = simulate(beam(3), scenario(placement=FALL), engine)
    pushed = simulate(beam(3), scenario(placement=FALL, pushes=PUSHES), engine)
    apart = (pushed.positions - calm.positions).astype(float)
    speed = np.diff(apart, axis=0).mean(axis=1) * 25
    drag = 0.2
    # Between the pushes, and after both: the air takes a little.
    first = np.array([1.2, 0, 0])
    assert speed[16] == pytest.approx(first * np.exp(-drag * 0.15), rel=0.05, abs=0.02)
    both = first * np.exp(-drag * 0.8) + np.array([-0.5, 2, 0]) * np.exp(-drag * 0.2)
    assert speed[32] == pytest.approx(both, rel=0.05, abs=0.02)
    assert not apart[:10].any()
    most = max(peak.ratio for peak in pushed.joint_peaks)
    assert most < 0.01 + max(peak.ratio for peak in calm.joint_peaks)


def test_pushes_and_wind_add_up(engine) -> None:
    gusts = {"strength": 4}
    trials = [
        simulate(beam(3), scenario(placement=FALL, **fields), engine).positions[-1].astype(float)
        for fields in ({}, {"gusts": gusts}, {"pushes": PUSHES}, {"gusts": gusts, "pushes": PUSHES})
    ]
    calm, blown, pushed, both = trials
    assert both - calm == pytest.approx((blown - calm) + (pushed - calm), abs=0.05)


def test_a_seed_draws_when_and_where_to_a_push_goes() -> None:
    draws = {"pushes.2.at_s": [0.8, 1.4], "pushes.1.velocity": [[-2, -1], [2, 1]]}
    worlds = [scenario(pushes=PUSHES, draws=draws).world(seed) for seed in range(20)]
    assert len({world.pushes for world in worlds}) == 20
    assert all(0.8 <= world.pushes[1].at_s <= 1.4 for world in worlds)
    assert {world.pushes[0].at_s for world in worlds} == {0.4}
    with pytest.raises(ValidationError, match="there is no '3', but 1, 2"):
        scenario(pushes=PUSHES, draws={"pushes.3.at_s": [0, 1]})
    with pytest.raises(ValidationError, match="velocity"):
        scenario(pushes=[{"at_s": 1, "velocity": [30, 0]}])


def mast() -> KeyedDraft:
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.start(), UP, 4)
    return draft


@pytest.mark.parametrize("tilt_deg", [-20.0, 3.0])
def test_a_machine_starts_tilted_and_touches_the_ground(engine, tilt_deg) -> None:
    place = {"kind": "ground", "tilt_deg": tilt_deg}
    trial = simulate(mast().machine, scenario(placement=place), engine)
    first = trial.positions[0].astype(float)
    top = first[-1] - first[0]
    angle = np.radians(tilt_deg)
    assert top == pytest.approx([0, 4 * np.sin(angle), 4 * np.cos(angle)], abs=0.01)
    assert first[0, :2] == pytest.approx([0, 0], abs=1e-3)
    # The edge on that side lies on the ground.
    rise = 0.5 * (np.cos(angle) + np.sin(abs(angle)))
    assert first[0, 2] == pytest.approx(rise, abs=0.01)
    assert trial.positions[-1, -1, 2] < 4.6


def test_a_machine_starts_turned_about_the_vertical(engine) -> None:
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.start(), NORTH, 4)
    place = {"kind": "ground", "heading_deg": 30}
    first = simulate(draft.machine, scenario(placement=place), engine).positions[0].astype(float)
    angle = np.radians(30)
    assert first[-1] - first[0] == pytest.approx(
        [4 * np.sin(angle), 4 * np.cos(angle), 0], abs=0.01
    )
    assert first[0, :2] == pytest.approx([0, 0], abs=1e-3)


def test_a_seed_draws_a_tilt_and_turns_it_little() -> None:
    tilted = scenario(
        placement={"kind": "ground", "tilt_deg": 2}, draws={"placement.tilt_deg": [-3, 3]}
    )
    structure = structure_of(mast().machine)
    ups = [start_of(structure, tilted.world(seed), seed).rotation[:, 2] for seed in range(20)]
    leans = np.degrees(np.arctan2([up[1] for up in ups], [up[2] for up in ups]))
    assert -3 <= leans.min() < -1 < 1 < leans.max() <= 3
    assert max(abs(up[0]) for up in ups) < 0.003


def test_a_cargo_is_above_the_highest_point_of_what_is_tilted() -> None:
    cargo = {"size": [1, 1, 1], "final_mass": 6, "ramp_s": 1, "drop_height": 2}
    draft = mast()
    draft.row("1", NORTH, 6)
    draft.row("1", EAST, 2)
    structure = structure_of(draft.machine)
    start = start_of(
        structure, scenario(placement={"kind": "ground", "tilt_deg": -60}, cargo=cargo)
    )
    assert start.cargo is not None
    top = max(
        (start.position + start.rotation @ shape.center)[2]
        + shape.turned(start.rotation).reach()[2]
        for part in structure.parts
        for shape in part.shapes
    )
    assert start.cargo.position[2] - 2.5 == pytest.approx(top)


def test_axes_are_sensed_without_a_place(engine) -> None:
    """What a program senses of itself where its place is none of its business."""
    program = """
    function control(t, sense)
      assert(sense.position == nil and sense.velocity == nil)
      assert(math.abs(sense.up.y - math.sin(0.05236)) < 1e-3 or t > 0)
      assert(math.abs(sense.forward.z + math.sin(0.05236)) < 1e-3 or t > 0)
      return { fly = sense.spin.z + sense.body_spin.z }
    end"""
    draft = mast()
    draft.bind(draft.attach("1", EAST, "Flying Block"), "fly", "Alpha1")
    fields = {
        "placement": {"kind": "ground", "tilt_deg": 3},
        "control": {"mode": "agent"},
        "senses": {"offers": ["axes"]},
    }
    trial = simulate(draft.machine.with_controller(program), scenario(**fields), engine)
    assert trial.piloting is not None
    assert trial.piloting.sense_names[0] == "up.x"
    assert len(trial.piloting.sense_names) == 12
    both = fields | {"senses": {"offers": ["axes", "pose"]}}
    asked = "function control(t, sense) return { fly = sense.position.x + sense.up.x } end"
    trial = simulate(draft.machine.with_controller(asked), scenario(**both), engine)
    assert trial.piloting is not None
    assert len(trial.piloting.sense_names) == 18


def test_a_scenario_without_them_reads_and_hashes_as_before() -> None:
    document = scenario(senses={}).model_dump(mode="json")
    assert "pushes" not in document
    assert document["placement"] == {"kind": "ground"}
    assert "axes" not in document["senses"]["offers"]
