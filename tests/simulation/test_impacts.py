"""A landing loads a machine alike, whichever step of an evaluation it falls into."""

import numpy as np
from support.machines.families import DOWN, NORTH, SOUTH, Draft

from buildarena_geometry import Machine
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.scenario import Control, ReleasedPlacement

STEP_S, STEPS, SPEED = 0.002, 20, 6.0


def _table() -> Machine:
    """A plank of nine blocks on a post."""
    draft = Draft()
    middle = draft.start()
    for way, count in ((DOWN, 2), (NORTH, 4), (SOUTH, 4)):
        draft.row(middle, way, count)
    return draft.machine


def _peak(machine: Machine, engine: str, height: float) -> float:
    """The largest share of its strength that a joint bears when it is thrown down."""
    place = ReleasedPlacement(height=height, velocity=(0.0, 0.0, -SPEED))
    scenario = Scenario(duration_s=0.48, control=Control(mode="agent"), placement=place)
    return float(np.max(simulate(machine, scenario, engine).joint_loads))


def test_a_landing_loads_alike_in_any_step_of_an_evaluation(engine) -> None:
    machine = _table()
    # Faster by the fall, the machine takes about a step for each of these differences in height.
    apart = STEP_S * (SPEED + 1.2)
    peaks = [_peak(machine, engine, 1.5 + k * apart) for k in range(STEPS)]
    assert max(peaks) < 1.4 * min(peaks)
