"""Machines for the game Besiege: machine files, scripts and levels out, files and logs in."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_besiege.errors import (
    BesiegeError,
    LogIncompleteError,
    MachineFileError,
    MachineNotPlayableError,
)
from buildarena_besiege.exporting.level import level_file
from buildarena_besiege.importing.machine import ImportedMachine, read_machine_file
from buildarena_besiege.key_remapping import lines_of_keys, remap_keys
from buildarena_besiege.logs.game_log import GameLog, run_ids
from buildarena_besiege.logs.level_check import level_finding
from buildarena_besiege.logs.published import looks_published, published_trajectory
from buildarena_besiege.logs.trajectories import logged_trajectory, trajectory_of
from buildarena_besiege.machine_reader import read_any_machine, read_presses
from buildarena_besiege.run import GameRun, plain_machine_file, prepare_run
from buildarena_besiege.starts import game_start

__all__ = [
    "BesiegeError",
    "GameLog",
    "GameRun",
    "ImportedMachine",
    "LogIncompleteError",
    "MachineFileError",
    "MachineNotPlayableError",
    "game_start",
    "level_file",
    "level_finding",
    "lines_of_keys",
    "logged_trajectory",
    "looks_published",
    "plain_machine_file",
    "prepare_run",
    "published_trajectory",
    "read_any_machine",
    "read_machine_file",
    "read_presses",
    "remap_keys",
    "run_ids",
    "trajectory_of",
]
