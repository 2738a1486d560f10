"""PyBullet's contact points as contact forces on blocks.

PyBullet names body and link of a contact, not the shape, so each goes to the nearest blocks.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from buildarena_simulation.engines.shared.closest_points import ShapeTable
from buildarena_simulation.structure.contacts import WORLD, ContactForces
from buildarena_simulation.structure.motion import Motion

TOUCHING: Final = 0.005
"""Distance of points below which they touch, even without a force of the solver, units."""


def read_contacts(
    contacts: Sequence[tuple[Any, ...]],
    cluster_of_link: Mapping[tuple[int, int], int],
    shapes: Sequence[ShapeTable],
    motion: Motion,
    *,
    outsiders: Mapping[int, int],
    surfaces: Mapping[int, int],
    added: Sequence[tuple[int, tuple[float, ...]]] = (),
) -> ContactForces:
    """Return the contact forces on all blocks.

    Args:
        contacts: Result of `getContactPoints`; each contact occurs once.
        cluster_of_link: Cluster of each body and link.
        shapes: (C,) shapes of each cluster.
        outsiders: Number in `ContactForces.other` of each moving body that is not a cluster.
        surfaces: Number of each fixed body in `ContactForces.surface`.
        added: Cluster and row of further forces: point, force, normal, fixed body.
    """
    rows: dict[int, list[tuple[float, ...]]] = {}
    for contact in contacts:
        push = contact[9]
        if push == 0.0 and contact[8] > TOUCHING:
            continue
        (nx, ny, nz), f1, (ux, uy, uz), f2, (vx, vy, vz) = contact[7], *contact[10:14]
        # The normal points from the second body to the first.
        x = nx * push + ux * f1 + vx * f2
        y = ny * push + uy * f1 + vy * f2
        z = nz * push + uz * f1 + vz * f2
        first = cluster_of_link.get((contact[1], contact[3]))
        second = cluster_of_link.get((contact[2], contact[4]))
        if first is not None:
            other = outsiders.get(contact[2], WORLD) if second is None else second
            fixed = surfaces.get(contact[2], -1)
            rows.setdefault(first, []).append((*contact[5], x, y, z, nx, ny, nz, other, fixed))
        if second is not None:
            other = outsiders.get(contact[1], WORLD) if first is None else first
            fixed = surfaces.get(contact[1], -1)
            rows.setdefault(second, []).append(
                (*contact[6], -x, -y, -z, -nx, -ny, -nz, other, fixed)
            )
    for c, row in added:
        rows.setdefault(c, []).append((*row[:9], WORLD, row[9]))
    if not rows:
        return _NONE
    inside = sorted(rows)
    table = np.array([row for c in inside for row in rows[c]])
    shares, first = [], 0
    for c in inside:
        last = first + len(rows[c])
        local = (table[first:last, :3] - motion.position[c]) @ motion.rotation[c]
        index, block, weight = shapes[c].share(local)
        shares.append((index + first, block, weight))
        first = last
    if len(shares) == 1:
        index, block, weight = shares[0]
    else:
        index, block, weight = (np.concatenate(each) for each in zip(*shares, strict=True))
    spread = table.take(index, 0)
    numbers = spread[:, 9:].astype(np.int64)
    return ContactForces(
        block=block,
        other=numbers[:, 0],
        surface=numbers[:, 1],
        weight=weight,
        area=np.zeros(len(block)),
        normal=spread[:, 6:9],
        point=spread[:, :3],
        force=spread[:, 3:6] * weight[:, None],
    )


_NONE: Final = ContactForces(
    block=np.zeros(0, dtype=np.int64),
    other=np.zeros(0, dtype=np.int64),
    surface=np.zeros(0, dtype=np.int64),
    weight=np.zeros(0),
    area=np.zeros(0),
    normal=np.zeros((0, 3)),
    point=np.zeros((0, 3)),
    force=np.zeros((0, 3)),
)
