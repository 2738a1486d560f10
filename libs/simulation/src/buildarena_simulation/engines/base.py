"""The seam between the shared model and an engine.

An engine builds bodies from clusters, steps them, and reports poses and contact forces. Loads,
breaking, control, heating and recording are shared and independent of the engine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.scenario import TerrainBox
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.contacts import ContactForces
from buildarena_simulation.structure.force_field import ForceField
from buildarena_simulation.structure.grips import Hold
from buildarena_simulation.structure.model import FloatArray, Shape, ShapeKind, Structure
from buildarena_simulation.structure.motion import Motion


@dataclass(frozen=True, slots=True, kw_only=True)
class CargoBox:
    """The cargo at the start of a trial.

    Attributes:
        size: (3,) full extents, units.
        position: (3,) its centre, world frame, units.
        mass: Mass units.
        rotation: (3, 3) world_from_cargo.
        is_ball: True for a ball, whose diameter the extents are.
    """

    size: FloatArray
    position: FloatArray
    mass: float
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    is_ball: bool = False

    def shape(self, center: FloatArray, rotation: FloatArray) -> Shape:
        """Return its solid at its present pose.

        Args:
            center: (3,) world frame, units.
            rotation: (3, 3) world_from_cargo.
        """
        return Shape(
            kind=ShapeKind.SPHERE if self.is_ball else ShapeKind.BOX,
            center=center,
            rotation=rotation,
            half_extents=self.size / 2,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Surroundings that an engine builds around the clusters.

    Attributes:
        ground: True if the plane z = 0 is solid.
        terrain: Fixed boxes.
        gravity: Downward acceleration, units/s².
        drive_strength: See `Scenario`; `field` already includes it.
        substeps: Number of substeps per default step of the engine.
        field: Forces that the blocks exert by themselves; None without. On a planet it includes
            gravity and drag, which the engine then omits.
        planet: Radius of the ball that is the ground, below the origin, units; None for a plane.
    """

    structure: Structure
    ground: bool
    terrain: tuple[TerrainBox, ...]
    cargo: CargoBox | None
    gravity: float
    drive_strength: float = 1.0
    substeps: int = 1
    field: ForceField | None = None
    planet: float | None = None

    @property
    def even_gravity(self) -> float:
        """Downward acceleration that the engine applies to everything, units/s²."""
        return self.gravity if self.planet is None else 0.0

    @property
    def force_unit(self) -> float:
        """Mass·unit/s² in a unit of the modules' forces, whatever the gravity is."""
        return GRAVITY

    @property
    def drive_unit(self) -> float:
        """The same for what drives joints."""
        return GRAVITY * self.drive_strength


@dataclass(frozen=True, slots=True, kw_only=True)
class CargoPose:
    """Pose and velocity of the cargo.

    Attributes:
        position: (3,) its centre, world frame, units.
        quaternion: (4,) world_from_cargo as (w, x, y, z).
        velocity: (3,) world frame, units/s.
        spin: (3,) world frame, rad/s.
    """

    position: FloatArray
    quaternion: FloatArray
    velocity: FloatArray
    spin: FloatArray


class Engine(Protocol):
    """A rigid-body engine with one world in it. Not shared between threads."""

    @property
    def time_step_s(self) -> float:
        """Length of one step, seconds; a sample interval is a whole number of steps."""

    @property
    def steps_per_evaluation(self) -> int:
        """Number of steps between two evaluations of the joint loads."""

    @property
    def settings(self) -> Mapping[str, float | int | str]:
        """Everything about this engine's set-up that can change a trajectory."""

    def enter(
        self,
        clusters: Clusters,
        motion: Motion,
        *,
        cargo: CargoPose | None = None,
        finer: int = 1,
    ) -> None:
        """Replace the clusters in the world.

        Args:
            cargo: New pose of the cargo; None leaves it unchanged.
            finer: Number of substeps per step from now on.
        """

    def set_cargo_mass(self, mass: float) -> None:
        """Change the cargo's mass and, in proportion, its inertia."""

    def blow(self, wind: FloatArray) -> None:
        """Set the acceleration of everything besides gravity from now on, (3,), units/s²."""

    def push_cargo(self, change: FloatArray) -> None:
        """Change the cargo's velocity by (3,), units/s, without touching anything else."""

    def drop_rope(self, index: int) -> None:
        """Remove a broken rope from the world."""

    def hold(self, holds: Sequence[Hold]) -> None:
        """Set the holds that start with the next `enter`, each at its point then."""

    def grip_wrenches(self) -> FloatArray:
        """Return the force and moment on each block that holds, about its hold's point, (H, 6).

        World frame, mass·unit/s² and mass·unit²/s², in the last step.
        """

    def advance(self, targets: FloatArray, thrusts: FloatArray, *, watched: bool = True) -> None:
        """Step the world.

        Args:
            targets: (S, D) target of each driven joint in each of S steps, as in
                `Schedule.targets`, relative to the block's base.
            thrusts: (C,) recoil of each cannon during these steps, mass·unit/s².
            watched: False if nobody asks for contacts and impacts of these steps.
        """

    def contacts(self) -> ContactForces:
        """Return the mean contact and friction forces on the blocks over the steps of `advance`."""

    @property
    def struck(self) -> bool:
        """True if there was an impact in the steps of `advance`."""

    def rope_tensions(self) -> FloatArray:
        """Return the tension of each rope in the last step, (R,), mass·unit/s²."""

    def motion(self) -> Motion:
        """Return the poses and velocities of the clusters now."""

    def cargo(self) -> CargoPose:
        """Return the pose of the cargo now; only in a world that has one."""

    def close(self) -> None:
        """Free the engine's memory."""


def principal_frames(clusters: Clusters) -> tuple[FloatArray, FloatArray]:
    """Return the principal axes and moments of the clusters' inertias.

    Returns:
        machine_from_principal (C, 3, 3), right-handed, and the moments (C, 3).
    """
    # Rounding keeps the axes of a symmetric machine from following the last bits.
    moments, axes = np.linalg.eigh(np.round(clusters.inertia, 12))
    axes[np.linalg.det(axes) < 0, :, 2] *= -1
    return axes, moments


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """Return the quaternion (w, x, y, z), w >= 0, of a rotation matrix; (..., 3, 3) to (..., 4).

    Source: the largest of the four squared components is found first, so no small number is
    divided by (Shepperd's method).
    """
    r = np.asarray(rotation, dtype=np.float64)
    trace = np.trace(r, axis1=-2, axis2=-1)
    diagonal = np.diagonal(r, axis1=-2, axis2=-1)
    squares = np.concatenate(
        [1.0 + trace[..., None], 1.0 + 2.0 * diagonal - trace[..., None]], axis=-1
    )
    w_row = [
        squares[..., 0],
        r[..., 2, 1] - r[..., 1, 2],
        r[..., 0, 2] - r[..., 2, 0],
        r[..., 1, 0] - r[..., 0, 1],
    ]
    x_row = [w_row[1], squares[..., 1], r[..., 0, 1] + r[..., 1, 0], r[..., 0, 2] + r[..., 2, 0]]
    y_row = [w_row[2], x_row[2], squares[..., 2], r[..., 1, 2] + r[..., 2, 1]]
    z_row = [w_row[3], x_row[3], y_row[3], squares[..., 3]]
    table = np.stack([np.stack(row, axis=-1) for row in (w_row, x_row, y_row, z_row)], axis=-2)
    best = np.argmax(squares, axis=-1)
    chosen = np.take_along_axis(table, best[..., None, None], axis=-2)[..., 0, :]
    chosen = chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)
    return np.asarray(np.where(chosen[..., :1] < 0, -chosen, chosen))


def rotation_of(quaternion: FloatArray) -> FloatArray:
    """Return the rotation matrix of a unit quaternion (w, x, y, z); (..., 4) to (..., 3, 3)."""
    wxyz = np.asarray(quaternion, dtype=np.float64)
    single = wxyz.ndim == 1
    w, x, y, z = wxyz.tolist() if single else np.moveaxis(wxyz, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows) if single else np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)
