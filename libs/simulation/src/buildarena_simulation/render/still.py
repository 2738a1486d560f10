"""Picture of a machine at a moment of its trial."""

import io
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.engines.base import quaternion_of
from buildarena_simulation.machine import structure_of
from buildarena_simulation.placement import start_of
from buildarena_simulation.render.camera import Camera
from buildarena_simulation.render.drawing import draw
from buildarena_simulation.render.scene import Scene
from buildarena_simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation.scenario import Scenario

SIZE: Final = (480, 320)
"""Width and height of a picture, pixels."""


def still_png(
    machine: "Machine", scenario: "Scenario", trajectory: Trajectory | None = None
) -> bytes:
    """Return a picture of a machine, without cargo, at its start in the trial.

    Args:
        trajectory: Trajectory whose last instant replaces the start.

    Returns:
        A PNG file; the same machine and scenario give the same picture.

    Raises:
        MachineNotSimulable: It has no blocks, or too many.
    """
    scene = Scene(machine, scenario, trajectory or _make_start(machine, scenario))
    camera = Camera.looking_at(
        scene.focus(-1), distance=2.2 * scene.reach(), size=SIZE, azimuth_deg=scene.azimuth_deg
    )
    out = io.BytesIO()
    draw(scene.at(-1), camera, size=SIZE, caption="").save(out, format="PNG", optimize=True)
    return out.getvalue()


def _make_start(machine: "Machine", scenario: "Scenario") -> Trajectory:
    """Return a trajectory of one instant, the start."""
    structure = structure_of(machine)
    start = start_of(structure, scenario)
    return Trajectory(
        time_s=np.zeros(1),
        block_ids=structure.block_ids,
        positions=(structure.shown @ start.rotation.T + start.position)[None].astype(np.float32),
        quaternions=quaternion_of(start.rotation @ structure.rotations)[None].astype(np.float32),
        cargo_position=None,
        cargo_quaternion=None,
        cargo_mass=None,
        cargo_size=None,
        cannon_ids=(),
        heated=np.zeros((1, 0), dtype=bool),
        joint_peaks=(),
        breaks=(),
        engine="",
        engine_version="",
        simulation_version="",
        settings={},
    )
