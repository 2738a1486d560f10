"""Which blocks rest on terrain, ground or under the cargo."""

import numpy as np
from support.machines.families import beam

from buildarena_simulation.engines.base import CargoBox, CargoPose, World
from buildarena_simulation.machine import structure_of
from buildarena_simulation.resting import FaceFinder
from buildarena_simulation.scenario import gap_terrain
from buildarena_simulation.structure.clusters import find_clusters
from buildarena_simulation.structure.contacts import CARGO, WORLD, ContactForces
from buildarena_simulation.structure.motion import at_rest


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
