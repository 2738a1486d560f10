"""What a user's module file says is what is simulated."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.building import BLOCK, built, connect
from support.machines.module_files import BASIC, like, module_file

from buildarena_geometry import Catalogue, Machine, load_catalogue
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.control import heated_cannons, recoil
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control


def _other(name: str, **fields: Any) -> dict[str, Any]:
    return like(name, "Other", **fields)


def _catalogue(folder: Path, module: dict[str, Any]) -> Catalogue:
    return load_catalogue(module_file(folder, module))


def _driven_car(catalogue: Catalogue | None, wheel: str) -> Machine:
    """A car of three blocks and four wheels that drives north from 0.2 s on."""
    sides = tuple((base, face, wheel) for base in ("2", "3") for face in "AB")
    machine = built(("1", "E", BLOCK), ("1", "F", BLOCK), *sides, catalogue=catalogue)
    for block in ("4", "5", "6", "7"):
        if "<South>" in machine.act("get_block_details", {"block_id": block}).text.split("\n")[0]:
            assert machine.act("flip_spin", {"block_id": block}).ok
        binding = {"block_id": block, "action": "spinning_forward", "new_key": "UpArrow"}
        assert machine.act("change_control_key", binding).ok
    press = {"time": 0.2, "key": "UpArrow", "hold_for": 3}
    assert machine.act("add_control_sequence", press).ok
    return machine


def test_a_wheel_turns_at_its_own_speed(tmp_path, engine) -> None:
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
    tmp_path, engine, name
) -> None:
    new = ("motor", "thrust", "physics")
    entry = {key: value for key, value in _other(name).items() if key not in new}
    catalogue = _catalogue(tmp_path, entry)
    scenario = Scenario(duration_s=0.4, control=Control(mode="held"))
    first, second = (
        simulate(built(("1", "A", part), ("1", "B", part), catalogue=catalogue), scenario, engine)
        for part in (name, "Other")
    )
    assert (first.positions == second.positions).all()
    assert (first.quaternions == second.quaternions).all()


def test_a_cannon_pushes_and_is_heated_as_its_entry_says(tmp_path) -> None:
    thrust = {
        **BASIC["Water Cannon"]["thrust"],
        "along": -0.5,
        "cold": 2.0,
        "heated": 20.0,
        "spheres": [{"along": 3.0, "radius": 0.5}],
    }
    catalogue = _catalogue(tmp_path, _other("Water Cannon", thrust=thrust))
    structure = structure_of(built(("1", "A", "Other"), ("1", "B", "Torch"), catalogue=catalogue))
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


def test_a_ropes_module_is_known_by_what_it_is_and_not_by_its_name(tmp_path) -> None:
    catalogue = _catalogue(tmp_path, _other("Brace", link="rope", mass=0.2))
    machine = built(("1", "A", BLOCK), catalogue=catalogue)
    assert connect(machine, "1", "C", "2", "E", connector="Other").ok
    structure = structure_of(machine)
    assert structure.ropes.names == ("Other 3",)
    assert structure.masses.sum() == pytest.approx(0.25 + 0.3 + 0.2)
