"""MJCF text of moving joints, their drives and their gears.

A simple axle is written at its present angle, as angle 0. Any other joint is written at its
position 0, where the machine was built, as its limits, spring and drive count from there; the
engine then moves it to its present position.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from buildarena_simulation.engines.mujoco.xml_text import opened, tag
from buildarena_simulation.engines.shared.joint_frames import (
    drive_of,
    driven_clusters,
    engaged,
    is_simple,
    joint_type_of,
    swing_axes,
)
from buildarena_simulation.structure.clusters import Clusters, limits_of
from buildarena_simulation.structure.model import FloatArray, Structure

_STOP_SOLREF = (0.008, 1.0)
"""Time constant, seconds, and damping ratio of a joint's stops."""

_TIE_SOLREF = (0.004, 1.0)
"""The same for couplings of joints: teeth, and the halves of a constant-velocity joint."""

_TIE_SOLIMP = (0.9999, 0.9999, 0.001)
"""Impedance of such a coupling: hard."""

_SERVO_SLACK = 0.01
"""Distance from its set point at which a drive exerts its full force, rad or units."""

_SERVO_TIME_S = 0.02
"""Time constant with which a drive reaches its set point, seconds."""

_ROTOR_INERTIA = 1e6
"""Inertia of a motor's rotor, so large that its clutch hardly affects it in a step, mass·unit²."""

_ARMATURE = 1e-3
"""Inertia added to each hinge of a constant-velocity joint: two of them share an axis when it is
straight, mass·unit²."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointText:
    """Input of the text of joints.

    Attributes:
        axes: (C, 3, 3) machine_from_principal.
        force_unit: Mass·unit/s² in a unit of the modules' forces.
        drive_unit: The same for the drives of joints.
    """

    structure: Structure
    clusters: Clusters
    axes: FloatArray
    force_unit: float
    drive_unit: float

    def joints(self, c: int) -> Iterator[str]:
        """Yield the joints between a cluster and its parent."""
        structure, clusters = self.structure, self.clusters
        pivot = structure.joints.points[clusters.attached[c]]
        pos = self.axes[c].T @ (pivot - clusters.center_of_mass[c])
        axis = self.axes[c].T @ structure.joints.axes[clusters.attached[c]]
        if is_simple(structure, clusters, c):
            yield tag("joint", name=f"hinge {c}", type="hinge", pos=pos, axis=axis, armature=0.01)
            return
        joint_type = joint_type_of(structure, clusters, c)
        if joint_type == "constant_velocity":
            yield from self._halves(c, pos)
            return
        kind = {"slider": "slide", "ball": "ball"}.get(joint_type, "hinge")
        more: dict[str, object] = {} if kind == "ball" else {"axis": axis}
        yield tag(
            "joint",
            name=f"hinge {c}",
            type=kind,
            pos=pos,
            **more,
            **self._stops(c),
            **self._rest(c),
        )

    def equalities(self) -> Iterator[str]:
        """Yield the constraints between joints: halves of constant-velocity joints, and teeth."""
        structure, clusters = self.structure, self.clusters
        for c in np.flatnonzero(clusters.parent >= 0).tolist():
            if joint_type_of(structure, clusters, c) == "constant_velocity":
                yield self._tied(f"hinge {c} 2", f"hinge {c}", 1.0)
        for first, second, ratio in engaged(structure, clusters):
            yield self._tied(f"hinge {second}", f"hinge {first}", ratio)

    def drives(self) -> Iterator[str]:
        """Yield the drives that hold a position."""
        for c in driven_clusters(self.structure, self.clusters):
            drive = drive_of(self.structure, self.clusters, c)
            if drive is None or drive.kind != "position":
                continue
            limit = drive.force * self.drive_unit
            kp = limit / _SERVO_SLACK
            yield tag(
                "general",
                name=f"hinge {c}",
                joint=f"hinge {c}",
                biastype="affine",
                gainprm=kp,
                biasprm=(0.0, -kp, -kp * _SERVO_TIME_S),
                forcerange=(-limit, limit),
            )

    def rotors(self) -> Iterator[str]:
        """Yield the rotors, which turn at a motor's target speed at any load; see `clutches`."""
        for c, _ in self._motors():
            yield opened("body", name=f"rotor {c}")
            inertia = (_ROTOR_INERTIA,) * 3
            yield tag("inertial", pos=(0.0, 0.0, 0.0), mass=1.0, diaginertia=inertia)
            yield tag("joint", name=f"rotor {c}", type="hinge", axis=(0.0, 0.0, 1.0))
            yield "</body>"

    def clutches(self) -> Iterator[str]:
        """Yield the friction between motors' rotors and their joints, at most their torque.

        So a motor holds its speed exactly up to its torque, and a brake its place.
        """
        for c, limit in self._motors():
            yield opened(
                "fixed",
                name=f"clutch {c}",
                frictionloss=limit,
                solreffriction=_TIE_SOLREF,
                solimpfriction=_TIE_SOLIMP,
            )
            yield tag("joint", joint=f"hinge {c}", coef=1.0)
            yield tag("joint", joint=f"rotor {c}", coef=-1.0)
            yield "</fixed>"

    def _motors(self) -> Iterator[tuple[int, float]]:
        """Yield the clusters that are driven at a speed, and the most that drives them."""
        for c in driven_clusters(self.structure, self.clusters):
            drive = drive_of(self.structure, self.clusters, c)
            if drive is None:
                yield c, float(self.structure.torques[self.clusters.attached[c]]) * self.drive_unit
            elif drive.kind == "speed":
                yield c, drive.force * self.drive_unit

    def _halves(self, c: int, pos: FloatArray) -> Iterator[str]:
        """Yield three hinges whose outer ones turn alike: two universal joints, back to back."""
        axes = self.axes[c].T @ swing_axes(self.structure, self.clusters, c)
        limits = limits_of(self.structure, self.clusters, c)
        for k, name in enumerate((f"hinge {c}", f"hinge {c} 1", f"hinge {c} 2")):
            # The outer hinges turn by half of what the shaft bends.
            share = 1.0 if k == 1 else 0.5
            stops = {} if limits is None else self._stop_at(share * np.array(limits))
            yield tag(
                "joint",
                name=name,
                type="hinge",
                pos=pos,
                axis=axes[:, k],
                armature=_ARMATURE,
                **stops,
            )

    def _stops(self, c: int) -> dict[str, object]:
        limits = limits_of(self.structure, self.clusters, c)
        return {} if limits is None else self._stop_at(np.array(limits))

    def _stop_at(self, limits: FloatArray) -> dict[str, object]:
        return {"range": limits, "solreflimit": _STOP_SOLREF}

    def _rest(self, c: int) -> dict[str, object]:
        """Return the friction, spring and damper."""
        joint = self.structure.parts[self.clusters.attached[c]].module.joint
        if joint is None:
            return {}
        amounts = {
            "frictionloss": joint.friction,
            "stiffness": joint.stiffness,
            "damping": joint.damping,
        }
        return {name: amount * self.force_unit for name, amount in amounts.items() if amount}

    def _tied(self, name: str, other: str, ratio: float) -> str:
        return tag(
            "joint",
            joint1=name,
            joint2=other,
            polycoef=(0.0, ratio, 0.0, 0.0, 0.0),
            solref=_TIE_SOLREF,
            solimp=_TIE_SOLIMP,
        )
