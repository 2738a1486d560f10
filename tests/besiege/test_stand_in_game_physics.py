"""The stand-in game's physics: ours, of the machine as it is read, where its file puts it."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from stand_in_game.faults import Faults
from stand_in_game.game import Game, Settings
from stand_in_game.machine_file import FileMachine, read_machine_file
from stand_in_game.stage import as_built, rehearse
from stand_in_game.trial import Flight, Inputs, Placed, holds
from stand_in_machines import CARGO, QUARTER, STRAIGHT, machine_file, reporting

from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.scenario import Cargo, Control, SpanPlacement, gap_terrain

LOGS = Path(__file__).parents[1] / "data" / "simulation"
BACK = (0.0, -QUARTER[1], 0.0, QUARTER[3])
"""Our own placement turns a bridge this way; the published one the other way round."""

WHEEL, WOOD = "Powered Wheel", "Small Wooden Block"


def built(*attached: tuple[str, str, str]) -> Machine:
    machine = Machine()
    machine.act("start", {})
    for base, face, block in attached:
        arguments = {"base_block": base, "face": face, "new_block": block}
        assert machine.act("attach_block_to", arguments).ok
    return machine


def car() -> Machine:
    """Four wheels on three blocks, driven by one key."""
    axles = [("1", "E", WOOD), ("1", "F", WOOD)]
    wheels = [("2", "A", WHEEL), ("2", "B", WHEEL), ("3", "A", WHEEL), ("3", "B", WHEEL)]
    machine = built(*axles, *wheels)
    for block in ("4", "5", "6", "7"):
        rolls_north = machine.blocks[block].axis_xyz[0] > 0
        action = "spinning_forward" if rolls_north else "spinning_backward"
        for way, key in ((action, "UpArrow"),):
            arguments = {"block_id": block, "action": way, "new_key": key}
            assert machine.act("change_control_key", arguments).ok
    return machine


def read(text: str, folder: Path) -> FileMachine:
    path = folder / "m.bsg"
    path.write_text(text)
    return read_machine_file(path)


def played(game: Game, seconds: float, frame_s: float = 0.05) -> list[list[str]]:
    """The log's fields, oldest line first, after so much game time."""
    game.start()
    while not game.rollout_ready:
        time.sleep(0.01)
    while game.time_s < seconds - 1e-6:
        game.frame(frame_s)
    return [line.split(", ") for line in reversed(game.log.text().split("\n"))]


def loaded(text: str, folder: Path, **settings: object) -> Game:
    path = folder / "m.bsg"
    path.write_text(text)
    game = Game(Settings(log_lines=10_000, **settings), Faults())
    assert game.load(path), game.message
    return game


def test_a_driven_car_goes_as_in_our_own_simulation(tmp_path: Path) -> None:
    machine = car()
    script = reporting(["1"], keys={"UpArrow": (0.5, 1.5)})
    game = loaded(machine_file(machine, script=script), tmp_path, horizon_s=2.4)
    game.set_ground()
    lines = played(game, 2.4)
    press = KeyPress(time_s=0.5, key="UpArrow", hold_for_s=1.0)
    scenario = Scenario(duration_s=2.4, control=Control(mode="agent"))
    ours = simulate(machine, scenario, "mujoco", controls=[press])
    assert len(lines) == 60
    for sample, (update, _, x, up, north, _) in enumerate(lines, 1):
        assert int(update) == 4 * sample
        wanted = ours.positions[sample, 0]
        assert np.allclose([float(x), float(north), float(up)], wanted, atol=1e-4)
    assert float(lines[-1][4]) > 3


@pytest.mark.parametrize("turned", [False, True])
def test_a_bridge_bears_as_in_our_own_simulation(tmp_path: Path, turned: bool) -> None:
    """A beam over the gap of five, with a cargo whose mass the script raises."""
    faces = ("A", "B") if turned else ("E", "F")
    sides = [("1", faces[0], WOOD), ("2", "E", WOOD), ("3", "E", WOOD)]
    machine = built(*sides, ("1", faces[1], WOOD), ("5", "E", WOOD), ("6", "E", WOOD))
    cargo = Cargo(size=(2.5, 2.5, 1.5), final_mass=400, ramp_start_s=0.5, ramp_s=2.0)
    scenario = Scenario(
        duration_s=2.4,
        terrain=gap_terrain(5.0),
        cargo=cargo,
        placement=SpanPlacement(gap=5.0),
    )
    text = machine_file(
        machine,
        script=reporting([CARGO, "1"], top_mass=400),
        position=(0.0, 6.0, 0.0),
        rotation=BACK if turned else STRAIGHT,
        cargo=((0.0, 3.5, 0.0), (2.5, 2.5, 1.5)),
    )
    game = loaded(text, tmp_path, horizon_s=2.4, terrain=gap_terrain(5.0))
    lines = played(game, 2.4)
    ours = simulate(machine, scenario, "mujoco")
    assert ours.cargo_position is not None
    cargo_heights = [float(line[3]) for line in lines if line[1] == CARGO]
    deck_heights = [float(line[3]) for line in lines if line[1] == "1"]
    # The game tells where a block's root is: the cargo's is the middle of its underside.
    assert np.allclose(cargo_heights, ours.cargo_position[1:, 2] - 0.75, atol=2e-3)
    assert np.allclose(deck_heights, ours.positions[1:, 0, 2], atol=2e-3)
    assert cargo_heights[0] - cargo_heights[20] > 1  # it has fallen onto the beam


def test_set_ground_puts_the_lowest_point_on_the_floor(tmp_path: Path) -> None:
    machine = car()
    file = read(machine_file(machine, position=(2.0, 5.0, -3.0)), tmp_path)
    hanging, standing = Placed(file), Placed(file, on_ground=True)
    assert np.allclose(hanging.position, [2, -3, 5])
    assert np.allclose(standing.position, [2, -3, 1.005])


def test_a_cannon_fires_with_its_key_only_and_burns_with_a_torch_only(tmp_path: Path) -> None:
    heights, burning = {}, {}
    for torch in (False, True):
        for key in ("Alpha1", "Alpha2"):
            machine = built(("1", "E", "Water Cannon"), *([("1", "C", "Torch")] if torch else []))
            bind = {"block_id": "2", "action": "hold_to_fire", "new_key": "Alpha1"}
            assert machine.act("change_control_key", bind).ok
            text = machine_file(machine, script=reporting(["1", "2"], keys={key: (0.0, 9.0)}))
            game = loaded(text, tmp_path, horizon_s=0.4)
            lines = played(game, 0.4)
            heights[torch, key] = float(lines[-2][3])
            burning[torch] = {line[5] for line in lines if line[1] == "2"}
            assert {line[5] for line in lines if line[1] == "1"} == {"false"}
    assert heights[False, "Alpha1"] > heights[False, "Alpha2"] + 0.3
    assert burning[False] == {"false"}


@pytest.mark.parametrize(
    ("name", "hot"), [("engine-four-heated", True), ("engine-flame-at-the-waist", False)]
)
def test_heat_is_told_as_our_simulation_finds_it(tmp_path: Path, name: str, hot: bool) -> None:
    machine = Machine()
    for action in json.loads((LOGS / f"{name}.json").read_text())["actions"]:
        assert machine.act(action["op"], action["params"]).ok
    file = read(machine_file(machine), tmp_path)
    flight = Flight(Placed(file, on_ground=True), (), Inputs(), duration_s=0.2)
    cannons = [k for k, block in enumerate(file.blocks) if block.type_id == 56]
    assert cannons
    assert all(flight.part(cannon, 0.0).burning == hot for cannon in cannons)


def test_between_samples_blocks_are_on_the_way(tmp_path: Path) -> None:
    file = read(machine_file(built()), tmp_path)
    flight = Flight(Placed(file), (), Inputs(), duration_s=0.4)
    before, between, after = (flight.part(0, t).position[1] for t in (0.32, 0.34, 0.36))
    assert between == pytest.approx((before + after) / 2, abs=1e-6)
    assert flight.part(0, 99.0).position == flight.part(0, 0.4).position


def test_as_built_is_where_the_flight_begins(tmp_path: Path) -> None:
    machine = car()
    machine.act(
        "connect_blocks",
        {"block_a": "2", "face_a": "C", "block_b": "3", "face_b": "C", "connector": "Brace"},
    )
    text = machine_file(
        machine, rotation=QUARTER, cargo=((0.3, 4.0, 0.2), (4.0, 8.0, 1.5)), position=(1, 6, 2)
    )
    file = read(text, tmp_path)
    placed = Placed(file)
    flight = Flight(placed, (), Inputs(), duration_s=0.04)
    assert len(file.blocks) == 9
    for place in range(len(file.blocks)):
        start, part = as_built(placed, place), flight.part(place, 0.0)
        for name in ("position", "right", "up", "forward"):
            assert np.allclose(getattr(start, name), getattr(part, name), atol=2e-4), (place, name)
    box = placed.cargo_box()
    assert box is not None
    assert np.allclose(box.size, [8, 4, 1.5])
    assert np.allclose(box.position, [1.2, 1.7, 10.75])


def test_a_rehearsal_learns_keys_and_masses(tmp_path: Path) -> None:
    script = reporting(["1"], keys={"UpArrow": (0.5, 0.8), "Alpha1": (0.2, 99)}, top_mass=105)
    text = machine_file(built(), script=script, cargo=((0, 4, 0), (1, 1, 1)))
    inputs = rehearse(Placed(read(text, tmp_path)), duration_s=1.5)
    held = [p for p in inputs.presses if p.hold_for_s > 0]
    assert [(p.time_s, p.key) for p in held] == [(0.2, "alpha1"), (0.5, "uparrow")]
    assert [p.hold_for_s for p in held] == pytest.approx([1.3, 0.3])
    assert len(inputs.masses) == 151
    assert inputs.masses[0] == 5.0
    assert inputs.masses[1] == pytest.approx(5.5)
    assert inputs.masses[150] == pytest.approx(55.0)


def test_holds_of_keys_pressed_again_and_never_let_go() -> None:
    edges = [(0.1, "a", True), (0.2, "a", False), (0.3, "a", True), (0.4, "b", False)]
    assert [(p.time_s, p.key, p.hold_for_s) for p in holds(edges, 1.0)] == [
        (0.1, "a", pytest.approx(0.1)),
        (0.3, "a", pytest.approx(0.7)),
    ]


def test_frames_bring_all_updates_that_are_due_at_once(tmp_path: Path) -> None:
    game = loaded(machine_file(built(), script=reporting(["1"])), tmp_path, horizon_s=1.0)
    game.start()
    while not game.rollout_ready:
        time.sleep(0.01)
    game.frame(0.039)
    assert game.log.text() == ""
    game.frame(0.101)
    assert [line.split(",")[0] for line in game.log.text().split("\n")] == ["12", "8", "4"]
    game.frame(60.0)  # a frame that hung makes the game lag
    assert game.time_s < 0.5


def test_each_simulation_begins_with_an_empty_log_and_a_fresh_script(tmp_path: Path) -> None:
    game = loaded(machine_file(built(), script=reporting(["1"])), tmp_path, horizon_s=0.4)
    first = played(game, 0.2)
    game.stop()
    assert game.time_s == 0.0
    assert played(game, 0.2) == first


def test_a_script_that_fails_at_once_leaves_the_machine_to_fall(tmp_path: Path) -> None:
    script = "return {play = function() error('no luck') end}"
    game = loaded(machine_file(built(), script=script), tmp_path, horizon_s=0.4)
    lines = played(game, 0.4)
    assert len(lines) == 1
    assert lines[0][0].startswith("Lua error")
    assert game.part(0).position[1] < 4
