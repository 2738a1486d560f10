"""How blocks move on what they sit on, as arrays; which cogs engage."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from buildarena_geometry.modules.joints import MESH_COSINE, MESH_SLACK
from buildarena_simulation.structure.model import Joints, Mesh, Part


def joints_of(parts: Sequence[Part]) -> Joints:
    """How the blocks of a machine move on what they sit on.

    Args:
        parts: The blocks.
    """
    wheels = [i for i, part in enumerate(parts) if part.is_wheel]
    others = [i for i, part in enumerate(parts) if not part.is_wheel and _is_driven(part)]
    return Joints(
        axes=np.array([part.axis for part in parts]),
        points=np.array([part.pivot for part in parts]),
        simple=np.array([part.is_wheel and part.module.joint is None for part in parts]),
        driven=np.array([*wheels, *others], dtype=np.int64),
        meshes=_meshes(parts),
    )


def _is_driven(part: Part) -> bool:
    return part.module.joint is not None and part.module.joint.drive is not None


def _meshes(parts: Sequence[Part]) -> tuple[Mesh, ...]:
    """Cogs with parallel axes, beside each other, whose pitch circles touch."""
    cogs = [(i, part, part.module.gear) for i, part in enumerate(parts)]
    meshes = []
    for (i, first, first_gear), (j, second, second_gear) in combinations(cogs, 2):
        if first_gear is None or second_gear is None:
            continue
        alike = float(first.axis @ second.axis)
        apart = second.shapes[0].center - first.shapes[0].center
        along = float(apart @ first.axis)
        distance = float(np.linalg.norm(apart - along * first.axis))
        thickness = first.shapes[0].half_extents[2] + second.shapes[0].half_extents[2]
        touch = abs(distance - first_gear.pitch_radius - second_gear.pitch_radius) <= MESH_SLACK
        if touch and abs(alike) >= MESH_COSINE and abs(along) < thickness - MESH_SLACK:
            # On parallel axes cogs turn against each other, on opposite ones the same way.
            ratio = -float(np.sign(alike)) * first_gear.pitch_radius / second_gear.pitch_radius
            meshes.append(Mesh(first=i, second=j, ratio=ratio))
    return tuple(meshes)
