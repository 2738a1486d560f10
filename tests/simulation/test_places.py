"""Trials whose machine is let go in the air, whose cargo has a place, whose keys end."""

import json

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.building import built

from buildarena_geometry import KeyPress
from buildarena_simulation import MachineNotSimulable, Scenario, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.control import ended_presses
from buildarena_simulation.scenario import Cargo, Control

BOX = {"size": [1, 1, 1], "initial_mass": 2, "final_mass": 2, "ramp_s": 1}


def scenario(**fields: object) -> Scenario:
    return Scenario.model_validate({"duration_s": 0.4, **fields})


def test_unused_additions_leave_a_scenario_as_it_was() -> None:
    written = json.loads(scenario(cargo=BOX).model_dump_json())
    assert not {"gates", "marks", "clear_start"} & set(written)
    assert "at" not in written["cargo"]
    assert "until_s" not in written["control"]
    used = scenario(
        cargo=BOX | {"at": [0, 4, 0]},
        gates=[{"name": "first", "center": [4, 10], "half_width": 1.5}],
        marks=[{"name": "goal", "center": [4, 4, 0], "radius": 1}],
        control={"mode": "agent", "until_s": 3},
        clear_start=True,
    )
    assert Scenario.model_validate_json(used.model_dump_json()) == used


@pytest.mark.parametrize("seed", [None, 3])
def test_a_released_machine_flies_a_parabola(engine, beam, seed) -> None:
    given = scenario(placement={"kind": "released", "height": 40, "velocity": [3, 15, 2]})
    trial = simulate(beam, given, engine, seed=seed)
    start, t = trial.positions[0, 0].astype(float), 0.4
    assert trial.positions[0, :, 2].min() - 0.5 == pytest.approx(40, abs=0.06)
    moved = trial.positions[-1, 0] - start
    # The drag of wood takes a few per cent.
    assert moved[:2] == pytest.approx([3 * t, 15 * t], rel=0.06)
    assert moved[2] == pytest.approx(2 * t - GRAVITY * t**2 / 2, rel=0.06)


def test_a_cargo_stands_at_its_place(engine, beam) -> None:
    trial = simulate(beam, scenario(cargo=BOX | {"at": [3, 4, 0]}), engine)
    assert trial.cargo_position is not None
    assert np.abs(trial.cargo_position - [3, 4, 0.5]).max() < 0.02


WALL = {"center": [0, 2.2, 1], "size": [4, 1, 2]}


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"cargo": BOX | {"at": [0, 1.6, 0]}}, r"2 \(Small Wooden Block\) overlaps the cargo"),
        ({"cargo": BOX | {"at": [0.2, 0, 0]}}, r"block 1 \(Starting Block\) overlaps the cargo"),
        ({"terrain": [WALL | {"center": [0, 1.9, 1]}]}, r"block 2 .* overlaps terrain 1"),
        ({"terrain": [WALL | {"center": [0, 2.5, 0.2], "slope_deg": 45}]}, "terrain 1"),
        ({"terrain": [WALL | {"center": [5, 9, 9]}, WALL | {"center": [0, 0, 0]}]}, "terrain 2"),
    ],
)
def test_a_place_that_is_taken_is_refused(beam, given, named) -> None:
    with pytest.raises(MachineNotSimulable, match=named):
        simulate(beam, scenario(clear_start=True, **given))
    simulate(beam, scenario(**given))  # only where the scenario asks for it


@pytest.mark.parametrize(
    "given",
    [
        {"cargo": BOX | {"at": [0, 2, 0]}},
        {"terrain": [WALL]},
        {"terrain": [WALL | {"center": [0, 0, 3.1]}]},
        {"terrain": [WALL | {"center": [0, 3.1, 0], "slope_deg": 45}]},
    ],
)
def test_what_is_only_near_is_not(beam, given) -> None:
    simulate(beam, scenario(clear_start=True, **given))


def test_a_wheel_is_round_to_a_ridge() -> None:
    machine = built(("1", "A", "Powered Wheel"))
    # A ridge half a unit high: its box's corner lies inside the square around the wheel only.
    ridge = {"size": [9, 0.8, 0.8], "slope_deg": 45}
    peak = 0.5 - 0.4 * np.sqrt(2)
    near = scenario(clear_start=True, terrain=[ridge | {"center": [0, 1.1, peak]}])
    simulate(machine, near)
    with pytest.raises(MachineNotSimulable, match="Powered Wheel"):
        simulate(machine, scenario(clear_start=True, terrain=[ridge | {"center": [0, 0.8, peak]}]))


def test_keys_end_when_the_control_says_so() -> None:
    times = ((1.0, 2.0), (4.0, 9.0), (5.5, 1.0), (5.0, 0.0))
    presses = [KeyPress(time_s=begin, key="UpArrow", hold_for_s=hold) for begin, hold in times]
    ended = ended_presses(presses, Control(mode="agent", until_s=5.0))
    assert [(press.time_s, press.hold_for_s) for press in ended] == [(1.0, 2.0), (4.0, 1.0)]
    assert ended_presses(presses, Control(mode="agent")) is presses


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"placement": {"kind": "released", "height": 0}}, "greater than 0"),
        ({"placement": {"kind": "released", "height": 5, "velocity": [0, 999, 0]}}, "200"),
        ({"placement": {"kind": "thrown"}}, "'ground', 'span', 'released'"),
        ({"cargo": BOX | {"at": [0, 0, -3]}}, "greater than or equal to 0"),
        ({"gates": [{"name": "a", "center": [0, 0], "half_width": 1}] * 2}, "two places"),
        ({"marks": [{"name": "a\x00", "center": [0, 0, 0], "radius": 1}]}, "pattern"),
    ],
)
def test_what_makes_no_sense_is_refused(fields, said) -> None:
    with pytest.raises(ValidationError, match=said):
        scenario(**fields)


def test_cargo_at_a_place_keeps_its_ramp() -> None:
    cargo = Cargo(size=(1, 1, 1), initial_mass=20, final_mass=20, ramp_s=1, at=(0, 4, 0))
    assert {cargo.mass_at(t) for t in (0.0, 0.7, 9.0)} == {20.0}
