"""Where a trial starts: in the air, tilted, turned, at a place of its own, or where it is taken."""

import numpy as np
import pytest
from pydantic import ValidationError
from support.machines.building import KeyedDraft
from support.marks import nightly

from buildarena_benchmark.experts.drafting import NORTH, SOUTH, UP, WEST
from buildarena_geometry import KeyPress
from buildarena_simulation import MachineNotSimulable, Scenario, simulate
from buildarena_simulation.control import ended_presses
from buildarena_simulation.engines.base import rotation_of
from buildarena_simulation.scenario import Cargo, Control

BOX = {"size": [1, 1, 1], "initial_mass": 2, "final_mass": 2, "ramp_s": 1}


def scenario(**fields: object) -> Scenario:
    return Scenario.model_validate({"duration_s": 0.4, **fields})


def test_a_cargo_stands_at_its_place(engine, beam) -> None:
    trial = simulate(beam, scenario(cargo=BOX | {"at": [3, 4, 0]}), engine)
    assert trial.cargo_position is not None
    assert np.abs(trial.cargo_position - [3, 4, 0.5]).max() < 0.02


WALL = {"center": [0, 2.2, 1], "size": [4, 1, 2]}


LONG = BOX | {"size": [1, 8, 1], "at": [3, 0, 0]}
TAKEN = [
    ({"cargo": LONG | {"heading_deg": 90}}, "overlaps the cargo"),
    ({"cargo": BOX | {"at": [0, 1.6, 0]}}, r"2 \(Small Wooden Block\) overlaps the cargo"),
    ({"cargo": BOX | {"at": [0.2, 0, 0]}}, r"block 1 \(Starting Block\) overlaps the cargo"),
    ({"terrain": [WALL | {"center": [0, 1.9, 1]}]}, r"block 2 .* overlaps terrain 1"),
    ({"terrain": [WALL | {"center": [0, 2.5, 0.2], "slope_deg": 45}]}, "terrain 1"),
    ({"terrain": [WALL | {"center": [5, 9, 9]}, WALL | {"center": [0, 0, 0]}]}, "terrain 2"),
]
NEAR = [
    {"cargo": LONG},
    {"cargo": BOX | {"at": [0, 2, 0]}},
    {"terrain": [WALL]},
    {"terrain": [WALL | {"center": [0, 0, 3.1]}]},
    {"terrain": [WALL | {"center": [0, 3.1, 0], "slope_deg": 45}]},
]


def test_a_place_that_is_taken_is_refused_and_one_that_is_only_near_is_not(beam) -> None:
    for given, named in TAKEN:
        with pytest.raises(MachineNotSimulable, match=named):
            simulate(beam, scenario(clear_start=True, **given))
        simulate(beam, scenario(**given))  # only where the scenario asks for it
    for given in NEAR:
        simulate(beam, scenario(clear_start=True, **given))


def test_a_machine_in_a_tasks_things_place_is_refused(tasks) -> None:
    """In the ball's, the cargo's in the exact and another world, and in the well's."""
    world = round(tasks["place-2"].scenario.world(0).cargo.at[1])
    for name, rows, seed, message in (
        ("deliver-2", [(UP, 1), (NORTH, 7)], None, "overlaps the cargo"),
        ("place-2", [(NORTH, 2), (WEST, 6)], None, "overlaps the cargo"),
        ("place-2", [(NORTH if world > 0 else SOUTH, abs(world)), (WEST, 6)], 0, "the cargo"),
        ("fetch-1", [(NORTH, 4), (WEST, 8)], None, "overlaps terrain"),
    ):
        draft = KeyedDraft(modules="workshop")
        end = draft.start()
        for way, count in rows:
            end = draft.row(end, way, count)[-1] if count else end
        machine = draft.machine
        if tasks[name].takes_programs:
            machine = machine.with_controller("function control() return {} end")
        with pytest.raises(MachineNotSimulable, match=message):
            simulate(machine, tasks[name].scenario, "mujoco", seed=seed)


def test_keys_end_when_the_control_says_so() -> None:
    times = ((1.0, 2.0), (4.0, 9.0), (5.5, 1.0), (5.0, 0.0))
    presses = [KeyPress(time_s=begin, key="UpArrow", hold_for_s=hold) for begin, hold in times]
    ended = ended_presses(presses, Control(mode="agent", until_s=5.0))
    assert [(press.time_s, press.hold_for_s) for press in ended] == [(1.0, 2.0), (4.0, 1.0)]
    assert ended_presses(presses, Control(mode="agent")) is presses


def test_what_makes_no_sense_is_refused() -> None:
    for fields, said in (
        ({"placement": {"kind": "released", "height": 0}}, "greater than 0"),
        ({"placement": {"kind": "released", "height": 5, "velocity": [0, 999, 0]}}, "200"),
        ({"placement": {"kind": "thrown"}}, "'ground', 'span', 'released'"),
        ({"cargo": BOX | {"at": [0, 0, -3]}}, "greater than or equal to 0"),
        ({"gates": [{"name": "a", "center": [0, 0], "half_width": 1}] * 2}, "two places"),
        ({"marks": [{"name": "a\x00", "center": [0, 0, 0], "radius": 1}]}, "pattern"),
    ):
        with pytest.raises(ValidationError, match=said):
            scenario(**fields)


LOADED = Scenario(duration_s=0.4, cargo=Cargo(size=(1, 1, 1), final_mass=6, ramp_s=1))


@pytest.mark.parametrize("heading", [30.0, nightly(-90.0)])
def test_a_cargo_starts_turned_from_north_towards_east(beam, engine, heading) -> None:
    cargo = LOADED.cargo.model_copy(update={"at": (8.0, 0.0, 0.0), "heading_deg": heading})
    scenario = LOADED.model_copy(update={"cargo": cargo})
    trajectory = simulate(beam, scenario, engine)
    north = rotation_of(trajectory.cargo_quaternion.astype(float))[:, :, 1]
    expected = [np.sin(np.radians(heading)), np.cos(np.radians(heading)), 0.0]
    assert np.allclose(north[0], expected, atol=1e-3)
    assert np.allclose(north[-1], expected, atol=1e-2)


def mast() -> KeyedDraft:
    draft = KeyedDraft(modules="workshop")
    draft.row(draft.start(), UP, 4)
    return draft


@pytest.mark.parametrize("tilt_deg", [-20.0, nightly(3.0)])
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
