"""A car in the plane by Coulomb's law: what the engines' cars are held against."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from buildarena_geometry import Machine
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.machine import structure_of

_STEP_S = 2e-4
_CREEP = 1e-3
"""Slip below which friction falls off, units/s."""


@dataclass(frozen=True, kw_only=True)
class PlanarPath:
    """Where a planar car is.

    Attributes:
        travelled: Length of its path, units.
        turned: How far it has turned, rad, anticlockwise.
        place: (2,) its place, units; it starts at (0, 0) and heads along the second axis.
        loads: (W,) what its wheels bear at the end, mass·g.
    """

    travelled: float
    turned: float
    place: NDArray[np.float64]
    loads: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PlanarCar:
    """A rigid car whose wheels yield alike, on a plane.

    Each wheel stands on the two ends of its lowest line. They bear what a plane over their places
    says, so that weight, friction at the ground, the wheels' spin-up and the turning of their spin
    are in balance; friction is against the slip. The wheels driven follow the motor's lag.

    Attributes:
        mass: Mass units.
        inertia: About the vertical through the centre of mass, mass·unit².
        radius: Of the wheels, and the height of the centre of mass, units.
        spin_inertia: Of a wheel about its axle, mass·unit².
        places: (W, 2) middles of the wheels from the centre of mass, units.
        half_width: Of a wheel, units.
        driven: (W,) which wheels turn; the others are held.
        friction: Coefficient of the wheels.
        drag: Of all, 1/s.
        speed: At which wheels are driven, rad/s.
        lag_per_s: With which they reach it.
    """

    mass: float
    inertia: float
    radius: float
    spin_inertia: float
    places: NDArray[np.float64]
    half_width: float
    driven: NDArray[np.bool_]
    friction: float
    drag: float
    speed: float
    lag_per_s: float

    def drive(self, duration_s: float) -> PlanarPath:
        """Drives for a while from rest."""
        sides = self.half_width * np.array([[-1.0, 0.0], [1.0, 0.0]])
        points = (self.places[:, None] + sides).reshape(-1, 2)
        driven = np.repeat(self.driven, 2)
        base = np.column_stack([np.ones(len(points)), points])
        solved = base @ np.linalg.inv(base.T @ base)
        place, velocity, travelled = np.zeros(2), np.zeros(2), 0.0
        heading = turn = 0.0
        force = np.zeros_like(points)
        for k in range(round(duration_s / _STEP_S)):
            rest = math.exp(-self.lag_per_s * k * _STEP_S)
            rim = np.where(driven, self.speed * (1.0 - rest), 0.0)
            spin = self.spin_inertia * rim.sum() / 2
            gain = self.spin_inertia * self.lag_per_s * (self.speed * driven - rim).sum() / 2
            weight = self.mass * GRAVITY
            east, north = -self.radius * force.sum(axis=0)
            loads = np.maximum(solved @ [weight, east + spin * turn, north - gain], 0.0)
            cosine, sine = math.cos(heading), math.sin(heading)
            axes = np.array([[cosine, -sine], [sine, cosine]])
            slip = axes.T @ velocity + turn * np.column_stack([-points[:, 1], points[:, 0]])
            slip[:, 1] -= rim * self.radius
            size = np.sqrt((slip**2).sum(axis=1) + _CREEP**2)
            force = -self.friction * (loads / size)[:, None] * slip
            torque = (points[:, 0] * force[:, 1] - points[:, 1] * force[:, 0]).sum()
            velocity = velocity + _STEP_S * (
                axes @ force.sum(axis=0) / self.mass - self.drag * velocity
            )
            turn += _STEP_S * torque / self.inertia
            place = place + _STEP_S * velocity
            heading += _STEP_S * turn
            travelled += _STEP_S * float(np.hypot(*velocity))
        return PlanarPath(
            travelled=travelled,
            turned=heading,
            place=place,
            loads=loads.reshape(-1, 2).sum(axis=1) / GRAVITY,
        )


def planar_car(machine: Machine, braked: Sequence[str]) -> PlanarCar:
    """The planar car of a machine whose axles are as high as its centre of mass.

    Args:
        machine: A car that heads north.
        braked: Ids of the wheels that are not driven.
    """
    structure = structure_of(machine)
    center = structure.masses @ structure.centers_of_mass / structure.masses.sum()
    arms = structure.centers_of_mass - center
    inertia = structure.inertias[:, 2, 2] + structure.masses * (arms[:, :2] ** 2).sum(axis=1)
    wheels = [structure.parts[k] for k in structure.wheels]
    shapes = [wheel.shapes[0] for wheel in wheels]
    assert np.allclose([shape.center[2] for shape in shapes], center[2], atol=1e-3)
    first = wheels[0]
    assert first.module.motor is not None
    axle = structure.joints.axes[structure.wheels[0]]
    return PlanarCar(
        mass=float(structure.masses.sum()),
        inertia=float(inertia.sum()),
        radius=float(shapes[0].half_extents[0]),
        spin_inertia=float(axle @ structure.inertias[structure.wheels[0]] @ axle),
        places=np.array([(shape.center - center)[:2] for shape in shapes]),
        half_width=float(shapes[0].half_extents[2]),
        driven=np.array([wheel.id not in braked for wheel in wheels]),
        friction=first.physics.friction,
        drag=first.physics.linear_drag,
        speed=first.module.motor.speed,
        lag_per_s=first.module.motor.lag_per_s,
    )
