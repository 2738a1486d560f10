"""From a log to a trajectory: 25 samples a second in our world frame."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.keys import cannons
from buildarena_besiege.logs.game_log import GameLog
from buildarena_besiege.logs.late_start import proved_start
from buildarena_besiege.logs.log_samples import (
    filled,
    first_seen,
    latest,
    level_settings,
    log_samples,
    reported_names,
    require_whole,
)
from buildarena_besiege.logs.orientation import (
    centers_of,
    machine_rotations,
    placed_quaternions,
    turned,
)
from buildarena_besiege.logs.piloted import piloted_again
from buildarena_besiege.placement import global_pose
from buildarena_besiege.tracking import tracked_blocks
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_turn
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Quaternion
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.trajectory import (
    Piloting,
    Setting,
    Trajectory,
    rounded_positions,
    rounded_quaternions,
)

ENGINE: Final = "besiege"
READING_VERSION: Final = "1"
"""Rises with every change of how logs become trajectories."""

JOINED_DRIFT: Final = 1.0
"""A block whose distance from the starting block has changed by more is no longer joined, units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """All values in a log, at the trajectory's own instants.

    Attributes:
        block_ids: (N,) the tracked blocks.
        positions: (T, N, 3) Besiege's components, units.
        burning: (T, N) bool; False where not reported.
        destroyed: (T, N) bool, whether the game destroyed the block; None where not reported.
        cargo: (T, 3) Besiege's components, units; None without cargo.
        mass: (T,) the cargo's; None without cargo.
        of_roots: Whether positions are those of the blocks' roots; otherwise of their centres.
        piloting: What a program sensed and asked for; None where none acted.
    """

    block_ids: tuple[str, ...]
    positions: NDArray[np.float64]
    burning: NDArray[np.bool_]
    destroyed: NDArray[np.bool_] | None = None
    cargo: NDArray[np.float64] | None = None
    mass: NDArray[np.float64] | None = None
    of_roots: bool = True
    piloting: Piloting | None = None
    settings: Mapping[str, Setting] = field(default_factory=dict)


def trajectory_of(
    log: GameLog, machine: Machine, scenario: Scenario, *, game: str, mod: str
) -> Trajectory:
    """The trajectory in a run's log.

    Args:
        log: The run's log.
        machine: The machine that was played.
        scenario: The scenario it was prepared for.
        game: Version of the game.
        mod: Version of the mod that runs the script.

    Raises:
        LogIncompleteError: Something is missing, two lines contradict each other, or the
            machine's program does not answer again what the log says it did.
        ControllerFailed: The machine's program failed.
    """
    tracked = tracked_blocks(machine, scenario)
    presses = require_whole(log, machine, scenario, tracked)
    pilot = piloted_again(log, machine, scenario)
    count = len(tracked) + (scenario.cargo is not None)
    reported = log_samples(log, scenario, count)
    known = ~np.isnan(reported[:, :, 0]) if count else np.ones((len(reported), 0), dtype=bool)
    late = proved_start(machine, scenario, tracked, first_seen(reported, known))
    whole, longest = filled(reported, known, reported_names(tracked, scenario), late)
    positions = whole[:, : len(tracked), 1:4]
    samples = Samples(
        block_ids=tracked,
        positions=positions,
        burning=latest(reported[:, : len(tracked), 4], known[:, : len(tracked)]) > 0.0,
        destroyed=latest(reported[:, : len(tracked), 5], known[:, : len(tracked)]) > 0.0,
        cargo=whole[:, -1, 1:4] if scenario.cargo is not None else None,
        mass=whole[:, -1, 4] if scenario.cargo is not None else None,
        piloting=None if pilot is None else pilot.piloting(),
        settings={
            **({} if pilot is None else pilot.settings()),
            "effective_key_presses": presses if pilot is None else len(pilot.holds()),
            "filled_samples": int((~known[1:]).any(axis=1).sum()) if count else 0,
            "longest_gap_s": round(longest / SAMPLE_RATE_HZ, 6),
            **level_settings(log),
            "lag": "not told by the log",
            "run": hashlib.sha256(log.run_id.encode()).hexdigest()[:16],
            "log": hashlib.sha256(log.text().encode()).hexdigest()[:16],
        },
    )
    return made_trajectory(samples, machine, scenario, version=f"{game}-{mod}")


def made_trajectory(
    samples: Samples, machine: Machine, scenario: Scenario, *, version: str
) -> Trajectory:
    """The trajectory of samples that are complete.

    The game reports where blocks' roots are; a cargo is taken to be upright.

    Args:
        samples: What was reported.
        machine: The machine.
        scenario: What it was put through.
        version: Of game and mod.
    """
    ids = samples.block_ids
    count = len(samples.positions)
    turn = besiege_turn(global_pose(machine, scenario).rotation)
    hot = cannons(machine)
    heated = np.zeros((count, len(hot)), dtype=bool)
    for column, block in enumerate(hot):
        if block in ids:
            heated[:, column] = samples.burning[:, ids.index(block)]
    pieces = pieces_of(machine, ids, samples.positions, samples.destroyed)
    positions, quaternions, source = _poses(samples, machine, turn, pieces)
    cargo = None if samples.cargo is None else _ours(samples.cargo)
    if cargo is not None and samples.of_roots and scenario.cargo is not None:
        cargo = cargo + np.array([0.0, 0.0, scenario.cargo.size[2] / 2])
    return Trajectory(
        time_s=np.arange(count) / SAMPLE_RATE_HZ,
        block_ids=ids,
        positions=rounded_positions(positions),
        quaternions=rounded_quaternions(quaternions),
        cargo_position=None if cargo is None else rounded_positions(cargo),
        cargo_quaternion=None
        if cargo is None
        else rounded_quaternions(np.tile(np.array(turn), (count, 1))),
        cargo_mass=samples.mass,
        cargo_size=scenario.cargo.size
        if scenario.cargo is not None and cargo is not None
        else None,
        cannon_ids=hot,
        heated=heated,
        pieces=pieces,
        joint_peaks=(),
        breaks=(),
        piloting=samples.piloting,
        engine=ENGINE,
        engine_version=version,
        simulation_version=READING_VERSION,
        settings={
            **samples.settings,
            "quaternions": source,
            "cannons_not_reported": sum(block not in ids for block in hot),
            "scenario": hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()[:16],
        },
    )


def pieces_of(
    machine: Machine,
    block_ids: tuple[str, ...],
    positions: NDArray[np.float64],
    destroyed: NDArray[np.bool_] | None = None,
) -> NDArray[np.int16] | None:
    """(T, N) which piece each tracked block belongs to, as far as distances show.

    From the moment its distance from the first starting block differs by more than `JOINED_DRIFT`
    from that at the start, or the game destroys it, a block is a piece of its own.

    Args:
        machine: Gives the order of the blocks.
        block_ids: (N,) the tracked blocks.
        positions: (T, N, 3) units.
        destroyed: (T, N) whether the game destroyed the block.

    Returns:
        None if no starting block is tracked.
    """
    order = {block: number for number, block in enumerate(machine.blocks)}
    starts = [
        i for i, block_id in enumerate(block_ids) if machine.blocks[block_id].module.kind == "start"
    ]
    if not starts:
        return None
    first = min(starts, key=lambda i: order[block_ids[i]])
    apart = np.linalg.norm(positions - positions[:, first : first + 1], axis=2)
    held = np.abs(apart - apart[0]) <= JOINED_DRIFT
    if destroyed is not None:
        held &= ~destroyed
    joined = np.logical_and.accumulate(held, axis=0)
    joined[:, first] = True
    own = np.array([order[block] for block in block_ids], dtype=np.int16)
    return np.where(joined, own[first], own[None, :]).astype(np.int16)


def _poses(
    samples: Samples,
    machine: Machine,
    turn: Quaternion,
    pieces: NDArray[np.int16] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """(T, N, 3) centres, (T, N, 4) quaternions, and where the latter come from."""
    ids, places = samples.block_ids, _ours(samples.positions)
    placed = placed_quaternions(machine, ids, turn)
    rotations = None if pieces is None else _rotations(machine, ids, turn, places, pieces)
    if rotations is None:
        quaternions, source = np.repeat(placed[None], len(places), axis=0), "as placed"
    else:
        quaternions, source = turned(rotations, placed), "fitted to the blocks' places"
    if not samples.of_roots:
        return places, quaternions, source
    return centers_of(machine, ids, places, quaternions), quaternions, source


def _rotations(
    machine: Machine,
    block_ids: tuple[str, ...],
    turn: Quaternion,
    roots: NDArray[np.float64],
    pieces: NDArray[np.int16],
) -> NDArray[np.float64] | None:
    """(T, 3, 3) how the machine is turned; None if its tracked blocks do not show it."""
    pose = Pose(quaternion=turn)
    built = np.array(
        [pose.point(machine.blocks[block_id].world_from_block.xyz) for block_id in block_ids]
    )
    own = list(machine.blocks).index
    start = next(i for i in block_ids if machine.blocks[i].module.kind == "start")
    return machine_rotations(built.reshape(-1, 3), roots, pieces == own(start))


def _ours(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions in Besiege's components as positions in our world frame."""
    return np.asarray(positions[..., [0, 2, 1]])
