"""Simulate a machine in a scenario: structure loads, breaking, PyBullet and MuJoCo engines.

Importing this package loads no engine, no pyarrow and no scipy; `simulate` does, when called.
"""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_simulation.constants import DEFAULT_ENGINE
from buildarena_simulation.driving import Drive, pilot_of
from buildarena_simulation.engines.registry import ALL_ENGINES, ENGINES, engine_version
from buildarena_simulation.errors import (
    BuildarenaSimulationError,
    ControllerFailed,
    MachineNotSimulable,
    SimulationError,
    TrajectoryFormatError,
    UnknownEngineError,
)
from buildarena_simulation.parquet import read_trajectory, schema_of, write_trajectory
from buildarena_simulation.plays import Play, simulate, simulate_many
from buildarena_simulation.processor import processor
from buildarena_simulation.rollout import SIMULATION_VERSION, require_engine, world_of
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.trajectory import Bearing, Break, Event, JointPeak, Piloting, Trajectory

__all__ = [
    "ALL_ENGINES",
    "DEFAULT_ENGINE",
    "ENGINES",
    "SIMULATION_VERSION",
    "Bearing",
    "Break",
    "BuildarenaSimulationError",
    "ControllerFailed",
    "Drive",
    "Event",
    "JointPeak",
    "MachineNotSimulable",
    "Piloting",
    "Play",
    "Scenario",
    "SimulationError",
    "Trajectory",
    "TrajectoryFormatError",
    "UnknownEngineError",
    "engine_version",
    "pilot_of",
    "processor",
    "read_trajectory",
    "require_engine",
    "schema_of",
    "simulate",
    "simulate_many",
    "world_of",
    "write_trajectory",
]
