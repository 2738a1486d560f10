"""Joints bear only what they can: latches that let go, and joints that are free to move."""

import numpy as np
import pytest
from support.machines.latches import MECHANISMS, PRESSES, RELEASE_S, sprung_arm
from support.machines.rigs import Rig
from support.machines.trials import press

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, SOUTH, UP
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.clusters import find_clusters
from buildarena_simulation.structure.free_directions import FreeDirections, free_strains
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.stiffness import StiffnessModel
from buildarena_simulation.structure.vectors import turn_about

RELEASED = round(RELEASE_S * 25)
"""The last sample before the latch lets go."""


def tried(machine: Machine, engine: str, duration_s: float = 3.0) -> Trajectory:
    scenario = Scenario(duration_s=duration_s, control=Control(mode="agent"))
    return simulate(machine, scenario, engine, controls=PRESSES)


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("kind", MECHANISMS)
def test_what_a_latch_lets_go_moves_and_breaks_nothing(engine, kind) -> None:
    machine = MECHANISMS[kind]().machine
    trajectory = tried(machine, engine)
    assert not trajectory.breaks
    moved = trajectory.positions[:, 0:].astype(float)
    held, then = (np.abs(moved[k] - moved[0]).max() for k in (RELEASED, -1))
    assert held < 0.1
    assert then > 0.9


def test_a_released_arm_has_the_energy_of_its_spring(engine) -> None:
    """Motion, height, spring and what damping and air take add up until it hangs down."""
    draft = sprung_arm(springs=1, weights=3)
    machine, trajectory = draft.machine, tried(draft.machine, engine)
    structure = structure_of(machine)
    positions, turned = trajectory.positions.astype(float), _turns(trajectory)
    ropes = structure.ropes
    ends = []
    for block, point in ((ropes.first, ropes.first_point), (ropes.second, ropes.second_point)):
        arm = point - structure.positions[block]
        ends.append(positions[:, block] + np.einsum("tbij,bj->tbi", turned[:, block], arm))
    length = np.linalg.norm(ends[1] - ends[0], axis=2)[:, 0]
    draws = ropes.stiffness[0] * (length - 0.4 * length[0]) ** 2 / 2
    speed = np.gradient(positions, 0.04, axis=0)
    spin = np.linalg.norm(np.gradient(turned, 0.04, axis=0), axis=(2, 3)) / np.sqrt(2.0)
    moving = (speed**2).sum(axis=2) @ structure.masses / 2
    inertia = np.einsum("nii->n", structure.inertias) / 2
    moving += spin**2 @ inertia / 2
    height = GRAVITY * (positions[:, :, 2] @ structure.masses)
    air = (speed**2).sum(axis=2) @ (structure.masses * structure.linear_drag)
    lost = np.cumsum(ropes.damping[0] * np.gradient(length, 0.04) ** 2 + air) * 0.04
    whole = draws + moving + height + lost
    after = slice(RELEASED + 1, RELEASED + 8)  # then it strikes the post
    assert moving[after].max() > 0.5 * draws[RELEASED]
    assert not trajectory.breaks
    assert whole[after] == pytest.approx(whole[RELEASED], abs=0.03 * draws[RELEASED])


def test_a_braced_joint_bears_nothing_where_it_is_free() -> None:
    """Its braces bear all of it, as they would beside a pin, a rail or a ball."""
    for name, seen in (("Hinge", 1), ("Swivel", 1), ("Ball Joint", 3), ("Slider", 1), ("Axle", 2)):
        rig = Rig()
        joint = rig.attach(rig.row(rig.top, EAST, 2)[-1], EAST, name)
        end = rig.attach(joint, EAST)
        for side in (UP, NORTH, SOUTH):
            rig.connect(end, rig.top, side)
        structure = structure_of(rig.machine)
        members, (block, tip) = structure.members, map(structure.block_ids.index, (joint, end))
        member = members.second.tolist().index(block)
        holds = np.ones(len(members), dtype=bool)
        clusters = find_clusters(structure, holds)
        assert len(clusters) == 1, name
        solver = StiffnessModel(structure).factorize(clusters, holds)
        free = free_strains(members, member, structure.parts[block])
        assert free.shape == (6, seen), name
        for load in np.eye(6) * 100.0:
            wrenches = np.zeros((len(structure), 6))
            wrenches[tip] = load  # the ground is the first block
            borne = solver.solve(wrenches)[solver.inside.tolist().index(member)]
            assert free.T @ borne == pytest.approx(0.0, abs=1.0), (name, load)


def test_a_stop_pushes_back_and_bears_nothing_else() -> None:
    rig = Rig()
    hinge = rig.placed(rig.row(rig.top, EAST, 2)[-1], EAST, "Hinge", UP)
    rig.attach(hinge, EAST)
    structure = structure_of(rig.machine)
    clusters = find_clusters(structure, np.ones(len(structure.members), dtype=bool))
    (arm,) = np.flatnonzero(clusters.parent >= 0)
    axis = structure.joints.axes[clusters.attached[arm]]
    for angle_deg, held in ((0.0, ()), (60.0, ()), (89.9, (-100.0,)), (-89.9, (100.0,))):
        rotation = np.tile(np.eye(3), (len(clusters), 1, 1))
        rotation[arm] = turn_about(axis, np.radians(angle_deg))
        still = np.zeros((len(clusters), 3))
        motion = Motion(position=still, rotation=rotation, velocity=still, spin=still)
        for moment in (100.0, -100.0):
            about = moment * axis[None].copy()
            free = FreeDirections(structure, clusters)
            free.bound(np.array([arm]), motion, np.zeros((1, 3)), about)
            bears = moment if moment in held else np.copysign(0.01, moment)
            assert about[0] @ axis == pytest.approx(bears), (angle_deg, moment)


def test_letting_weights_go_lightens_no_load_that_stays() -> None:
    """The arm still carries all of its cargo in the moment in which it drops something else."""
    rig = Rig()
    arm = rig.row(rig.top, EAST, 4)
    rig.attach(arm[-1], DOWN, "Weight")
    for block in arm[1:4]:
        decoupler = rig.attach(block, UP, "Decoupler")
        rig.bind(decoupler, "decouple", f"Alpha{3 + arm.index(block)}")
        rig.attach(decoupler, UP)
    scenario = Scenario(duration_s=3.0, control=Control(mode="agent"))
    keys = tuple(press(f"Alpha{4 + k}", 1.5 + 0.3 * k, 0.1) for k in range(3))
    trajectory = simulate(rig.machine, scenario, "mujoco", controls=keys)
    assert len(trajectory.events) == 3
    joint = [peak.joint for peak in trajectory.joint_peaks].index(f"{rig.top}-{arm[0]}")
    loads = trajectory.joint_loads[:, joint].astype(float)
    assert loads[36:].min() > 0.7 * loads[36]


def _turns(trajectory: Trajectory) -> np.ndarray:
    w, x, y, z = np.moveaxis(trajectory.quaternions.astype(float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    now = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return now @ now[0].transpose(0, 2, 1)
