"""What a builder is told of a driven joint's direction is what the engines make it do."""

import numpy as np
import pytest
from support.machines.building import built

from buildarena_geometry import module_set
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.engines.base import rotation_of
from buildarena_simulation.scenario import Control

WAYS = {"<East>": (1, 0, 0), "<North>": (0, 1, 0), "<Up>": (0, 0, 1), "<Down>": (0, 0, -1)}


@pytest.mark.parametrize("flip", [False, True], ids=["as it is", "flipped"])
@pytest.mark.parametrize("twist", [0, 90])
def test_a_steering_hinge_swings_where_it_is_said_to(engine, twist, flip) -> None:
    hinge = ("1", "A", "Steering Hinge")
    machine = built(hinge, catalogue=module_set("workshop"), init_shift=[0, 0, 20])
    assert machine.act("twist_block", {"block_id": "2", "angle": twist}).ok
    if flip:
        assert machine.act("flip_spin", {"block_id": "2"}).ok
    told = machine.act("get_block_details", {"block_id": "2"}).text
    way = told.partition("swings its far end ")[2].split(">")[0] + ">"
    side = np.array(WAYS.get(way, (0, -1, 0)))  # the only other one here is <South>
    key = {"block_id": "2", "action": "turn_right", "new_key": "RightArrow"}
    assert machine.act("change_control_key", key).ok
    press = {"time": 0, "key": "RightArrow", "hold_for": 1}
    assert machine.act("add_control_sequence", press).ok
    scenario = Scenario(duration_s=0.4, control=Control(mode="agent"))
    trajectory = simulate(machine, scenario, engine=engine, seed=0)
    start, hinge = (rotation_of(trajectory.quaternions[-1, i].astype(float)) for i in (0, 1))
    far_end = start.T @ hinge[:, 2]  # its own z axis, as the starting block has it
    assert far_end @ side > 0.2
