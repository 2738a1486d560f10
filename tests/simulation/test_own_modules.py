"""What a user's module file says is what is simulated."""

import copy
import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.building import attach, connect

from buildarena_geometry import Catalogue, Machine, load_catalogue
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.control import heated_cannons, recoil
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control

FILE = resources.files("buildarena_geometry.modules").joinpath("modules.yaml")
BASIC = {module["name"]: module for module in json.loads(FILE.read_text())["modules"]}


def _other(name: str, **fields: Any) -> dict[str, Any]:
    return {**copy.deepcopy(BASIC[name]), "name": "Other", **fields}


def _catalogue(folder: Path, module: dict[str, Any]) -> Catalogue:
    file = folder / "modules.json"
    file.write_text(json.dumps({"version": 1, "modules": [module]}))
    return load_catalogue(file)


def _built(catalogue: Catalogue | None, *parts: tuple[str, str, str]) -> Machine:
    machine = Machine(catalogue=catalogue)
    assert machine.act("start").ok
    for base, face, module in parts:
        assert attach(machine, base, face, module).ok
    return machine


def _driven_car(catalogue: Catalogue | None, wheel: str) -> Machine:
    """A car of three blocks and four wheels that drives north from 0.2 s on."""
    sides = tuple((base, face, wheel) for base in ("2", "3") for face in "AB")
    machine = _built(
        catalogue, ("1", "E", "Small Wooden Block"), ("1", "F", "Small Wooden Block"), *sides
    )
    for block in ("4", "5", "6", "7"):
        if "<South>" in machine.act("get_block_details", {"block_id": block}).text.split("\n")[0]:
            assert machine.act("flip_spin", {"block_id": block}).ok
        binding = {"block_id": block, "action": "spinning_forward", "new_key": "UpArrow"}
        assert machine.act("change_control_key", binding).ok
    press = {"time": 0.2, "key": "UpArrow", "hold_for": 3}
    assert machine.act("add_control_sequence", press).ok
    return machine


def test_a_wheel_turns_at_its_own_speed(tmp_path: Path, engine: str) -> None:
    motor = {**BASIC["Powered Wheel"]["motor"], "speed_rpm": 50}
    slow = _catalogue(tmp_path, _other("Powered Wheel", motor=motor))
    scenario = Scenario(duration_s=3.0, control=Control(mode="agent"))
    reached = [
        np.linalg.norm(np.diff(simulate(machine, scenario, engine).positions[-25:, 0], axis=0))
        for machine in (_driven_car(None, "Powered Wheel"), _driven_car(slow, "Other"))
    ]
    assert reached[1] == pytest.approx(reached[0] / 2, rel=0.05)


@pytest.mark.parametrize("name", ["Powered Wheel", "Water Cannon", "Torch", "Small Wooden Block"])
def test_a_file_that_says_nothing_of_physics_is_simulated_like_its_kind(
    tmp_path: Path, engine: str, name: str
) -> None:
    new = ("motor", "thrust", "physics")
    entry = {key: value for key, value in _other(name).items() if key not in new}
    catalogue = _catalogue(tmp_path, entry)
    scenario = Scenario(duration_s=0.4, control=Control(mode="held"))
    first, second = (
        simulate(_built(catalogue, ("1", "A", part), ("1", "B", part)), scenario, engine)
        for part in (name, "Other")
    )
    assert (first.positions == second.positions).all()
    assert (first.quaternions == second.quaternions).all()


def test_a_cannon_pushes_and_is_heated_as_its_entry_says(tmp_path: Path) -> None:
    thrust = {
        **BASIC["Water Cannon"]["thrust"],
        "along": -0.5,
        "cold": 2.0,
        "heated": 20.0,
        "spheres": [{"along": 3.0, "radius": 0.5}],
    }
    catalogue = _catalogue(tmp_path, _other("Water Cannon", thrust=thrust))
    structure = structure_of(_built(catalogue, ("1", "A", "Other"), ("1", "B", "Torch")))
    (cannon,), (torch,) = structure.cannons, structure.torches
    expected = structure.shown[cannon] - 0.5 * structure.directions[cannon]
    assert structure.thrust_points[0] == pytest.approx(expected)
    shown, ways = np.zeros((len(structure), 3)), np.zeros((len(structure), 3))
    ways[cannon], ways[torch] = (0, 0, -1), (0, 0, -1)
    shown[torch] = (0, 0, -2)
    assert heated_cannons(structure, shown, ways)[0]
    shown[torch] = (0, 0, 0)
    assert not heated_cannons(structure, shown, ways)[0]
    fired = np.array([True])
    cold, hot = (recoil(structure, fired, np.array([heat]))[0] for heat in (False, True))
    assert hot / cold == pytest.approx(10)


def test_a_ropes_module_is_known_by_what_it_is_and_not_by_its_name(tmp_path: Path) -> None:
    catalogue = _catalogue(tmp_path, _other("Brace", link="rope", mass=0.2))
    machine = _built(catalogue, ("1", "A", "Small Wooden Block"))
    assert connect(machine, "1", "C", "2", "E", connector="Other").ok
    structure = structure_of(machine)
    assert structure.ropes.names == ("Other 3",)
    assert structure.masses.sum() == pytest.approx(0.25 + 0.3 + 0.2)
