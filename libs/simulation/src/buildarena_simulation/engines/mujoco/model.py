"""MJCF text of a world: what MuJoCo compiles.

Every number is written in full, every inertial frame is stated: what MJCF leaves open would be
filled in by the compiler from the collision shapes.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_simulation.constants import FRICTION_TERRAIN
from buildarena_simulation.engines.base import World, quaternion_of
from buildarena_simulation.engines.mujoco.model_joints import JointText
from buildarena_simulation.engines.mujoco.xml_text import opened, tag
from buildarena_simulation.engines.shared.joint_frames import is_simple
from buildarena_simulation.scenario import TerrainBox
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import CARGO, WORLD
from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray, ShapeKind, Structure
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.solids import Solid
from buildarena_simulation.terrain import shape_of

_SIZE_OF_FORM: Final = {
    ShapeKind.BOX: [0, 1, 2],
    ShapeKind.CYLINDER: [0, 2],
    ShapeKind.SPHERE: [0],
}
_TERRAIN_PRIORITY, _CARGO_PRIORITY, _BLOCK_PRIORITY, _WHEEL_PRIORITY = 0, 1, 2, 3
"""A contact takes its friction from the geom of higher priority."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MjcfSettings:
    """The solver's settings in the text.

    Attributes:
        time_step_s: Length of a step, seconds.
        solref: Time constant, seconds, and damping ratio of contacts and ropes.
        friction_s: Time constant with which friction on ground and terrain stops a slip, seconds.
        solimp: Impedance of contacts.
        impratio: Stiffness of friction over that of normal forces.
        iterations: Maximum iterations of the solver.
    """

    time_step_s: float
    solref: Sequence[float]
    friction_s: float
    solimp: Sequence[float]
    impratio: float
    iterations: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MjcfState:
    """Bodies of a text.

    Attributes:
        solids: Collision shapes by cluster.
        axes: (C, 3, 3) machine_from_principal.
        moments: (C, 3) principal moments of inertia.
        cargo_mass: Mass of the cargo now, mass units.
        ropes: Indices of the ropes that hold.
        holds: Holds of blocks.
    """

    clusters: Clusters
    motion: Motion
    solids: Sequence[Sequence[Solid]]
    axes: FloatArray
    moments: FloatArray
    cargo_mass: float
    ropes: Sequence[int]
    holds: Sequence[Hold] = ()

    def in_body(self, c: int, point: FloatArray) -> FloatArray:
        """Convert a machine-frame point to a cluster's body frame, its principal frame."""
        return np.asarray(self.axes[c].T @ (point - self.clusters.center_of_mass[c]))


def mjcf_of(world: World, state: MjcfState, settings: MjcfSettings) -> str:
    """Return the MJCF text of a world with its clusters.

    Bodies are named "cluster C", their joints "hinge C", free joints "free C", geoms "solid C K",
    sites and actuators of cannons "cannon N", tendons "rope R", the cargo "cargo"; a motor's rotor
    and its joint "rotor C", its tendon "clutch C"; contacts with ground and terrain "wheel …" and
    "block …".
    """
    joints = JointText(
        structure=world.structure,
        clusters=state.clusters,
        axes=state.axes,
        force_unit=world.force_unit,
        drive_unit=world.drive_unit,
    )
    lines = [
        "<mujoco>",
        '<compiler angle="radian" autolimits="true" inertiafromgeom="false"/>',
        opened(
            "option",
            timestep=settings.time_step_s,
            gravity=(0.0, 0.0, -world.even_gravity),
            integrator="implicitfast",
            cone="elliptic",
            impratio=settings.impratio,
            iterations=settings.iterations,
            jacobian="dense",
            tolerance=1e-10,
            ccd_tolerance=1e-9,
            ccd_iterations=200,
        ),
        '<flag autoreset="disable" nativeccd="disable"/>',
        "</option>",
        "<default>",
        tag("geom", condim=3, solref=settings.solref, solimp=settings.solimp),
        tag("tendon", solreflimit=settings.solref),
        "</default>",
        "<worldbody>",
        *_static(world),
        *_cargo(world, state.cargo_mass),
        *_components(world.structure, state, joints),
        *joints.rotors(),
        "</worldbody>",
        "<contact>",
        *_exclusions(state.clusters),
        *_surface_pairs(world, state, settings),
        "</contact>",
        "<tendon>",
        *_ropes(world.structure, state),
        *joints.clutches(),
        "</tendon>",
        "<equality>",
        *joints.equalities(),
        "</equality>",
        *_welds(state),
        "<actuator>",
        *joints.drives(),
        *_cannons(world.structure, state),
        "</actuator>",
        "</mujoco>",
    ]
    return "\n".join(lines)


def _static(world: World) -> Iterator[str]:
    surface: dict[str, object] = {
        "friction": _friction(FRICTION_TERRAIN),
        "priority": _TERRAIN_PRIORITY,
    }
    if world.planet is not None:
        ball: dict[str, object] = {"size": (world.planet,), "pos": (0.0, 0.0, -world.planet)}
        yield tag("geom", name="ground", type="sphere", **ball, **surface)
    elif world.ground:
        yield tag("geom", name="ground", type="plane", size=(0.0, 0.0, 1.0), **surface)
    for i, box in enumerate(world.terrain):
        yield tag(
            "geom",
            name=f"terrain {i}",
            type="box",
            size=np.array(box.size) / 2,
            pos=box.center,
            **_turn_of(box),
            **surface,
        )


def _turn_of(box: TerrainBox) -> dict[str, object]:
    if not box.heading_deg:
        return {"euler": (math.radians(box.slope_deg), 0.0, 0.0)}
    return {"quat": quaternion_of(shape_of(box).rotation)}


def _cargo(world: World, mass: float) -> Iterator[str]:
    cargo = world.cargo
    if cargo is None:
        return
    a, b, c = cargo.size
    moments = mass / 12 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    if cargo.is_ball:
        moments = np.full(3, mass * a**2 / 10)
    turn = quaternion_of(cargo.rotation)
    yield opened("body", name="cargo", pos=cargo.position, quat=turn)
    yield tag("inertial", pos=(0.0, 0.0, 0.0), mass=mass, diaginertia=moments)
    yield "<freejoint/>"
    yield tag(
        "geom",
        name="cargo",
        type="sphere" if cargo.is_ball else "box",
        size=cargo.size[:1] / 2 if cargo.is_ball else cargo.size / 2,
        friction=_friction(FRICTION_TERRAIN),
        priority=_CARGO_PRIORITY,
    )
    yield "</body>"


def _components(structure: Structure, state: MjcfState, joints: JointText) -> Iterator[str]:
    for component in state.clusters.components:
        yield from _body(structure, state, joints, component[0])


def _body(structure: Structure, state: MjcfState, joints: JointText, c: int) -> Iterator[str]:
    """Yield a cluster's body and, inside it, those attached to it by joints."""
    clusters, motion = state.clusters, state.motion
    centers = motion.centers_of_mass(clusters)
    parent = int(clusters.parent[c])
    turn = motion.rotation[c] @ state.axes[c]
    if parent < 0:
        place = centers[c]
    elif not is_simple(structure, clusters, c):
        place = state.in_body(parent, clusters.center_of_mass[c])
        turn = state.axes[parent].T @ state.axes[c]
    else:
        to_parent = (motion.rotation[parent] @ state.axes[parent]).T
        place, turn = to_parent @ (centers[c] - centers[parent]), to_parent @ turn
    yield opened("body", name=f"cluster {c}", pos=place, quat=quaternion_of(turn))
    yield tag("inertial", pos=(0.0, 0.0, 0.0), mass=clusters.mass[c], diaginertia=state.moments[c])
    if parent < 0:
        yield tag("freejoint", name=f"free {c}")
    else:
        yield from joints.joints(c)
    yield from _solids(state, c)
    yield from _cannon_sites(structure, state, c)
    yield from _rope_sites(structure, state, c)
    for child in np.flatnonzero(clusters.parent == c):
        yield from _body(structure, state, joints, int(child))
    yield "</body>"


def _solids(state: MjcfState, c: int) -> Iterator[str]:
    solids = state.solids[c]
    quaternions = quaternion_of(np.array([state.axes[c].T @ solid.rotation for solid in solids]))
    for k, solid in enumerate(solids):
        half = solid.half_extents
        yield tag(
            "geom",
            name=f"solid {c} {k}",
            type=str(solid.kind),
            size=half[_SIZE_OF_FORM[solid.kind]],
            pos=state.in_body(c, solid.center),
            quat=quaternions[k],
            friction=_friction(solid.friction),
            priority=_WHEEL_PRIORITY if solid.is_wheel else _BLOCK_PRIORITY,
        )


def _cannon_sites(structure: Structure, state: MjcfState, c: int) -> Iterator[str]:
    for cannon in np.flatnonzero(state.clusters.cluster_of[structure.cannons] == c):
        place = state.in_body(c, structure.thrust_points[cannon])
        yield tag("site", name=f"cannon {structure.cannons[cannon]}", pos=place)


def _rope_sites(structure: Structure, state: MjcfState, c: int) -> Iterator[str]:
    ropes, of = structure.ropes, state.clusters.cluster_of
    for r in state.ropes:
        ends = ((ropes.first[r], ropes.first_point[r]), (ropes.second[r], ropes.second_point[r]))
        for k, (block, point) in enumerate(ends):
            if of[block] == c:
                yield tag("site", name=f"rope {r} {k}", pos=state.in_body(c, point))


def _exclusions(clusters: Clusters) -> Iterator[str]:
    """Exclude contacts between parts of one articulated component."""
    for component in clusters.components:
        for i, first in enumerate(component):
            for second in component[i + 1 :]:
                yield tag("exclude", body1=f"cluster {first}", body2=f"cluster {second}")


def _surface_pairs(world: World, state: MjcfState, settings: MjcfSettings) -> Iterator[str]:
    """Yield contacts with ground and terrain, with slower friction than the default.

    MuJoCo's contacts are convex: a fast slip lifts the sliding body, the more the harder friction
    pulls to stop it, and a wheel that spins would hop. Only contact pairs can set its rate.
    """
    surfaces = ["ground"] * world.ground + [f"terrain {i}" for i in range(len(world.terrain))]
    sliding = [
        (f"solid {c} {k}", solid)
        for c, solids in enumerate(state.solids)
        for k, solid in enumerate(solids)
    ]
    for name, solid in sliding:
        coefficient, roll, spin = _friction(solid.friction)
        kind = "wheel" if solid.is_wheel else "block"
        for surface in surfaces:
            yield tag(
                "pair",
                name=f"{kind} {name} {surface}",
                geom1=surface,
                geom2=name,
                condim=3,
                friction=(coefficient, coefficient, roll, spin, spin),
                solref=settings.solref,
                solreffriction=(settings.friction_s, 1.0),
                solimp=settings.solimp,
            )


def _ropes(structure: Structure, state: MjcfState) -> Iterator[str]:
    ropes = structure.ropes
    for r in state.ropes:
        length = ropes.length[r]
        if ropes.stiffness[r]:
            spring = {"stiffness": ropes.stiffness[r], "damping": ropes.damping[r]}
            yield opened("spatial", name=f"rope {r}", springlength=length, **spring)
        else:
            yield opened("spatial", name=f"rope {r}", limited="true", range=(0.0, length))
        yield tag("site", site=f"rope {r} 0")
        yield tag("site", site=f"rope {r} 1")
        yield "</spatial>"


def _cannons(structure: Structure, state: MjcfState) -> Iterator[str]:
    for i in structure.cannons:
        recoil = state.axes[state.clusters.cluster_of[i]].T @ -structure.directions[i]
        gear = (*recoil, 0.0, 0.0, 0.0)
        yield tag("general", name=f"cannon {i}", site=f"cannon {i}", gear=gear)


def _welds(state: MjcfState) -> Iterator[str]:
    """Yield the welds of blocks' holds, named "grip G"; their poses are set later."""
    if not state.holds:
        return
    yield "<equality>"
    for hold in state.holds:
        c = int(state.clusters.cluster_of[hold.block])
        names = {WORLD: "", CARGO: "cargo"}
        other = names.get(hold.other)
        if other is None:
            other = f"cluster {state.clusters.cluster_of[hold.other]}"
        # The held body comes first: a weld's point is one of its second body.
        first = {"body1": other or "world", "body2": f"cluster {c}"}
        yield tag("weld", name=f"grip {hold.grip}", anchor=state.in_body(c, hold.point), **first)
    yield "</equality>"


def _friction(coefficient: float) -> tuple[float, float, float]:
    return (coefficient, 0.005, 0.0001)
