"""Clusters, joints, loads and what rests on what, without any engine."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.machines.building import KeyedDraft
from support.machines.families import beam, car, deck
from support.machines.trials import gap_terrain

from buildarena_benchmark.experts.drafting import DOWN, EAST, NORTH, UP, WEST
from buildarena_geometry import Machine
from buildarena_simulation.constants import GRAVITY, JointKind
from buildarena_simulation.engines.base import CargoBox, CargoPose, World
from buildarena_simulation.machine import structure_of
from buildarena_simulation.resting import FaceFinder
from buildarena_simulation.structure.clusters import Clusters, find_clusters
from buildarena_simulation.structure.contacts import (
    CARGO,
    WORLD,
    ContactForces,
    EvenSharing,
    PointForces,
)
from buildarena_simulation.structure.loads import LoadModel
from buildarena_simulation.structure.model import JOINT_KINDS, Structure
from buildarena_simulation.structure.motion import Motion, at_rest


def _clusters(structure: Structure) -> Clusters:
    return find_clusters(structure, np.ones(len(structure.members), dtype=bool))


def _kinds(machine: Machine) -> list[JointKind]:
    return [JOINT_KINDS[k] for k in structure_of(machine).members.kind]


def test_a_beam_is_one_cluster_and_a_car_five() -> None:
    assert len(_clusters(structure_of(beam(7)))) == 1
    clusters = _clusters(structure_of(car()))
    assert len(clusters) == 5
    assert len(clusters.components) == 1
    assert (clusters.parent[1:] == 0).all()
    assert clusters.attached_is_outer[1:].all()


def test_axles_leave_free_what_nothing_else_holds() -> None:
    def clusters_of(*ways: tuple[int, int, int], north: int = 0) -> int:
        """Blocks on wheels to these ways, joined by a brace to each other or to the start."""
        draft = KeyedDraft()
        middle = draft.start()
        seats = [middle, draft.row(middle, NORTH, north)[-1] if north else middle]
        ends = [draft.attach(draft.wheel(s, w), w) for s, w in zip(seats, ways, strict=False)]
        if ways:
            draft.connect(*(ends if len(ends) > 1 else (middle, *ends)), UP)
        return len(_clusters(structure_of(draft.machine)))

    assert clusters_of(EAST) == 1, "a brace across an axle locks it"
    assert clusters_of(EAST, WEST) == 2, "a second axle on the same line leaves the first free"
    assert clusters_of(EAST, EAST, north=2) == 1, "one beside the first locks both"
    draft = KeyedDraft()
    draft.attach(draft.wheel(draft.start(), EAST), EAST)
    clusters = _clusters(structure_of(draft.machine))
    assert sorted(map(len, clusters.blocks)) == [1, 2]
    # The larger cluster is the root, so the wheel's mount hangs on it.
    assert not clusters.attached_is_outer[1]


def test_a_small_blocks_far_end_grabs_what_it_touches() -> None:
    draft = KeyedDraft()
    middle = draft.start()
    draft.row(middle, UP, 2)
    corner = draft.row(draft.row(middle, EAST, 2)[-1], UP, 2)[-1]
    # Side by side is not end to face: nothing is grabbed yet.
    assert JointKind.FAR_JOINT not in _kinds(draft.machine)
    draft.row(corner, WEST, 1)
    assert _kinds(draft.machine).count(JointKind.FAR_JOINT) == 1


def test_mass_and_inertia_are_those_of_the_blocks_and_brace_halves() -> None:
    machine = deck(3, 5, cross=True)
    structure = structure_of(machine)
    clusters = _clusters(structure)
    assert clusters.mass[0] == pytest.approx(machine.mass)
    assert clusters.center_of_mass[0] == pytest.approx(machine.center_of_mass, abs=1e-9)
    lone = structure_of(beam(7))
    along, across = sorted(np.linalg.eigvalsh(_clusters(lone).inertia[0]))[::2]
    masses = [0.25, *[0.3] * 6]
    assert along == pytest.approx(sum(masses) / 6)
    distances = [0, 1, 2, 3, 1, 2, 3]
    expected = sum(m * (1 / 6 + d**2) for m, d in zip(masses, distances, strict=True))
    assert across == pytest.approx(expected)


def test_a_strut_weighs_and_buckles_by_its_length(subtests) -> None:
    for length in (1, 3, 5, 8):
        with subtests.test(length=length):
            draft = KeyedDraft(modules="all")
            foot = draft.start()
            *between, head = draft.row(foot, UP, length + 1)
            draft.connect(foot, head, UP, DOWN, connector="Strut")
            for block in between:
                draft.do("remove_block", block_id=block)
            assert draft.machine.mass == pytest.approx(0.25 + 0.3 + 0.5 * length)
            structure = structure_of(draft.machine)
            assert structure.masses.sum() == pytest.approx(draft.machine.mass)
            # Source: Euler's column with both ends free to turn.
            most = min(600.0, math.pi**2 * 973.0 / length**2)
            assert _strut_bears(structure, pressed=100.0) == pytest.approx(100.0 / most)
            assert _strut_bears(structure, pressed=-100.0) == pytest.approx(100.0 / 600.0)


def _strut_bears(structure: Structure, *, pressed: float) -> float:
    """Share of its strength that a strut upright between two blocks bears."""
    clusters = _clusters(structure)
    motion = at_rest(clusters, np.zeros(3), np.eye(3))
    forces = PointForces(
        block=np.array([0, 1]),
        point=structure.centers_of_mass,
        force=pressed * GRAVITY * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]),
    )
    weightless = LoadModel(structure, clusters, motion, gravity=0.0)
    return float(weightless.evaluate(forces, motion, elapsed_s=1.0, seen_s=1e3).ratio[0])


vectors = st.tuples(*[st.floats(-5, 5)] * 3).map(np.array)


@given(vectors, vectors, st.integers(0, 20))
@settings(max_examples=40, deadline=None)
def test_a_break_keeps_linear_and_angular_momentum(velocity, spin, broken) -> None:
    structure = structure_of(deck(3, 7))
    before = _clusters(structure)
    holds = np.ones(len(structure.members), dtype=bool)
    holds[broken % len(holds)] = False
    after = find_clusters(structure, holds)
    angle = float(np.linalg.norm(spin)) or 1.0
    x, y, z = spin / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
    motion = Motion(
        position=velocity[None] + 3.0,
        rotation=rotation[None],
        velocity=velocity[None],
        spin=spin[None],
    )
    split = motion.after_break(before, after)

    def momenta(clusters: Clusters, moving: Motion) -> tuple[np.ndarray, np.ndarray]:
        linear = (clusters.mass[:, None] * moving.velocity).sum(axis=0)
        turned = moving.rotation @ clusters.inertia @ moving.rotation.transpose(0, 2, 1)
        own = (turned @ moving.spin[:, :, None])[:, :, 0]
        orbit = np.cross(moving.centers_of_mass(clusters), clusters.mass[:, None] * moving.velocity)
        return linear, (own + orbit).sum(axis=0)

    for kept, now in zip(momenta(before, motion), momenta(after, split), strict=True):
        assert np.allclose(kept, now, atol=1e-8)


@given(st.lists(st.tuples(vectors, vectors), min_size=2, max_size=12))
@settings(max_examples=60, deadline=None)
def test_sharing_a_patch_evenly_keeps_its_resultant(contacts) -> None:
    point = np.array([p for p, _ in contacts])
    force = np.array([f for _, f in contacts])
    force[:, 2] = np.abs(force[:, 2]) + 20.0
    count = len(point)
    given_ = ContactForces(
        block=np.arange(count),
        other=np.full(count, -1),
        surface=np.zeros(count, dtype=np.int64),
        weight=np.ones(count),
        area=np.zeros(count),
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        point=point,
        force=force,
    )
    shared = EvenSharing(np.zeros(count, dtype=np.int64)).shared(given_)
    assert np.allclose(shared.force.sum(axis=0), force.sum(axis=0), atol=1e-6)
    apart = np.linalg.svd(point - point.mean(axis=0), compute_uv=False)
    if apart[min(1, len(apart) - 1)] > 0.5 and (shared.force[:, 2] > 1e-6).all():
        kept = np.cross(point, force).sum(axis=0)
        now = np.cross(point, shared.force).sum(axis=0)
        assert np.allclose(now, kept, atol=1e-3 * (1.0 + np.abs(kept).max()))


def _beside(height: float, cargo_height: float, *, turn: np.ndarray | None = None) -> ContactForces:
    """What is found for a beam over a gap of 5 whose first end block alone is in touch."""
    structure = structure_of(beam(7))
    clusters = find_clusters(structure, np.ones(len(structure.members), dtype=bool))
    box = CargoBox(size=np.array([2.5, 2.5, 1.5]), position=np.zeros(3), mass=5.0)
    world = World(
        structure=structure, ground=True, terrain=gap_terrain(5.0), cargo=box, gravity=1.0
    )
    ends = np.argsort(structure.positions[:, 1])
    touching = ContactForces(
        block=ends[:1],
        other=np.array([WORLD]),
        surface=np.array([1]),
        weight=np.ones(1),
        area=np.zeros(1),
        normal=np.array([[0.0, 0.0, 1.0]]),
        point=np.array([[0.0, -3.0, 5.0]]),
        force=np.array([[0.0, 0.0, 9.0]]),
    )
    pose = CargoPose(
        position=np.array([0.0, 0.0, height + 0.5 + 0.75 + cargo_height]),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        velocity=np.zeros(3),
        spin=np.zeros(3),
    )
    motion = at_rest(clusters, np.array([0.0, 0.0, height]), np.eye(3) if turn is None else turn)
    faces = FaceFinder(world).find(clusters, motion, pose)
    found = faces.joined_to(touching, clusters.cluster_of)
    assert (found.force[1:] == 0.0).all()
    return found


def test_both_ends_and_all_blocks_below_the_cargo_rest() -> None:
    found = _beside(5.5 + 0.01, 0.01)
    structure = structure_of(beam(7))
    across = np.round(structure.positions[found.block, 1]).astype(int)
    assert sorted(across[found.other == WORLD]) == [-3, -3, 3]
    assert sorted(across[found.other == CARGO]) == [-1, 0, 1]
    assert np.allclose(found.normal[found.other == CARGO], [0, 0, -1])
    # The end blocks overhang the terrain's edge; their points lie on it.
    assert (np.abs(found.point[found.other == WORLD, 1]) >= 2.5).all()
    # The cargo, 2.5 wide, covers the outer blocks in part.
    assert np.allclose(sorted(found.area[found.other == CARGO]), [0.75, 0.75, 1.0])
    # What the engine reports keeps its force and leaves its weight to the face.
    assert (found.weight[0], found.force[0, 2]) == (0.0, 9.0)
    assert sorted(found.surface[found.other == WORLD]) == [1, 1, 2]


def test_what_is_farther_than_a_hair_does_not() -> None:
    found = _beside(5.5 + 0.06, 0.06)
    assert len(found.block) == 1


def test_what_does_not_lie_flat_does_not() -> None:
    c, s = np.cos(0.5), np.sin(0.5)
    rolled = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    assert len(_beside(5.5, 3.0, turn=rolled).block) == 1
