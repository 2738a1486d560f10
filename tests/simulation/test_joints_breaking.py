"""Joints that move break by what they bear, and the record tells what that was."""

import numpy as np
import pytest
from support.machines.rigs import Rig

from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import JOINT_STRENGTH, JointKind
from buildarena_simulation.machine import structure_of
from buildarena_simulation.rollout import simulate_structure
from buildarena_simulation.scenario import Control
from buildarena_worker.builtin.designs.drafting import DOWN, EAST, NORTH, UP, WEST

KINDS = {
    "Hinge": "hinge",
    "Swivel": "hinge",
    "Slider": "slider",
    "Ball Joint": "ball",
    "Axle": "constant_velocity",
    "Steering Block": "hinge",
}


def _hung(joint: str, weights: int) -> tuple[Rig, str]:
    """Weights that hang from a joint under an arm, clear of the mast."""
    rig = Rig()
    seat = rig.attach(rig.row(rig.top, EAST, 4)[-1], DOWN, joint)
    end = seat
    for _ in range(weights):
        end = rig.attach(end, DOWN, "Weight")
    return rig, seat


def _tried(rig: Rig, engine: str, duration_s: float = 2.0) -> Trajectory:
    scenario = Scenario(duration_s=duration_s, control=Control(mode="agent"))
    return simulate(rig.machine, scenario, engine)


@pytest.mark.nightly(keep=5)
@pytest.mark.parametrize("joint", KINDS)
def test_a_joint_bears_what_hangs_on_it(engine, joint) -> None:
    rig, seat = _hung(joint, 3)
    trajectory = _tried(rig, engine, 3.0)
    assert not trajectory.breaks
    peak = next(peak for peak in trajectory.joint_peaks if peak.joint == f"6-{seat}")
    assert peak.kind == KINDS[joint]
    place = [p.joint for p in trajectory.joint_peaks].index(peak.joint)
    settled = trajectory.joint_loads[-1, place] * JOINT_STRENGTH[JointKind(peak.kind)].force
    load = 30 + rig.machine.blocks[seat].module.mass
    assert settled == pytest.approx(load, rel=0.04)


@pytest.mark.nightly(keep=9)
@pytest.mark.parametrize("joint", KINDS)
@pytest.mark.parametrize(("strength", "holds"), [(1.15, True), (0.9, False)])
def test_a_joint_breaks_above_its_strength_and_lets_go(
    engine: str, joint: str, strength: float, *, holds: bool
) -> None:
    rig, seat = _hung(joint, 3)
    structure = structure_of(rig.machine)
    k = structure.members.names.index(f"6-{seat}")
    # A stop that is reached in falling bears more than the weight for a moment.
    extra = 3.0 if joint == "Slider" else 1.0
    load = (30 + rig.machine.blocks[seat].module.mass) * strength * (extra if holds else 1.0)
    structure.members.limits[k, 0] = load
    scenario = Scenario(duration_s=2.0)
    trajectory = simulate_structure(structure, scenario, engine)
    assert [(one.joint, one.kind) for one in trajectory.breaks[:1]] == (
        [] if holds else [(f"6-{seat}", KINDS[joint])]
    )
    height = trajectory.positions[:, trajectory.block_ids.index(seat), 2]
    assert (height[0] - height[-1] > 2.0) != holds


def test_a_swinging_hinge_bears_the_pull_of_its_swing(engine) -> None:
    # A bob that falls from level pulls three times its weight at the bottom.
    rig = Rig()
    swivel = rig.attach(rig.row(rig.top, NORTH, 3)[-1], NORTH, "Swivel")
    arm = rig.row(swivel, EAST, 3)[-1]
    rig.attach(arm, EAST, "Weight")
    trajectory = _tried(rig, engine, 1.4)
    loads = trajectory.joint_loads[
        :, [p.joint for p in trajectory.joint_peaks].index(f"5-{swivel}")
    ]
    force = next(p.force for p in trajectory.joint_peaks if p.joint == f"5-{swivel}")
    mass = 10 + 0.9 + 0.5
    # The filter of the loads takes a part of so short a peak.
    assert 2.0 * mass < force < 3.0 * mass
    assert loads.max() < 1.0


def test_what_a_motor_exerts_goes_into_its_base(engine) -> None:
    # A block that spins an arm against gravity's moment hands that moment on to its mount.
    rig = Rig()
    block = rig.attach(rig.row(rig.top, NORTH, 3)[-1], NORTH, "Steering Block")
    rig.attach(rig.attach(block, EAST), EAST, "Weight")
    trajectory = _tried(rig, engine)
    moment = next(p.moment for p in trajectory.joint_peaks if p.joint == f"5-{block}")
    level = next(p.moment for p in trajectory.joint_peaks if p.joint == "4-5")
    assert moment == pytest.approx(10 * 2 + 0.3, rel=0.15)
    assert level > moment * 0.9


def test_pieces_fly_apart_with_the_motion_they_had(engine) -> None:
    # A spinning arm whose hub breaks away keeps turning at the speed it had.
    rig = Rig()
    block = rig.attach(rig.top, UP, "Spinning Block")
    ends = [rig.row(block, side, 3)[-1] for side in (EAST, WEST)]
    for end in ends:
        rig.attach(end, UP)
    trajectory = _tried(rig, engine, 1.2)
    assert not trajectory.breaks
    turning = np.linalg.norm(np.diff(trajectory.positions[-10:], axis=0), axis=2)
    hub = trajectory.block_ids.index(block)
    assert turning[:, hub].max() < 0.01
    assert turning[:, trajectory.block_ids.index(ends[0])].min() > 0.5
