"""Conversion of a log to a trajectory: 25 samples a second in the world frame."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from buildarena_besiege.errors import LogIncompleteError, MachineNotPlayableError
from buildarena_besiege.exporting.pilot import pilot_of
from buildarena_besiege.keys import UPDATES_PER_S, cannons
from buildarena_besiege.logs.game_log import GameLog
from buildarena_besiege.logs.log_samples import (
    filled,
    find_first_known,
    latest,
    level_settings,
    log_samples,
    reported_names,
    require_complete,
)
from buildarena_besiege.logs.orientation import (
    centers_of,
    initial_quaternions,
    machine_rotations,
    turned,
)
from buildarena_besiege.placement import global_pose
from buildarena_besiege.starts import game_start
from buildarena_besiege.tracking import tracked_blocks
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_turn
from buildarena_geometry.poses import Pose
from buildarena_geometry.rotations import Quaternion
from buildarena_simulation import Scenario
from buildarena_simulation.constants import GRAVITY, SAMPLE_RATE_HZ
from buildarena_simulation.controllers.pilot import ProgramPilot
from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.trajectory import (
    Piloting,
    Setting,
    Trajectory,
    rounded_positions,
    rounded_quaternions,
)

ALIKE: Final = 1.001e-6
"""Tolerance between an answer in the log and the program's answer here: its last decimal."""

_TICK_UPDATES: Final = UPDATES_PER_S // SAMPLE_RATE_HZ


def piloted_again(log: GameLog, machine: Machine, scenario: Scenario) -> ProgramPilot | None:
    """Run a machine's program again on its senses in the game, and return it.

    Returns:
        None if no program acted.

    Raises:
        ControllerFailed: The program failed in the game, and fails here too.
        LogIncompleteError: A tick is missing, or the program answers differently here.
    """
    ticks = _ticks(log)
    if not machine.controller or not ticks:
        return None
    pilot = pilot_of(machine, scenario)
    sense_count, order = len(pilot.sense_names), sorted(pilot.channels.names)
    failed = {line.update for line in log.lines if line.kind == "f"}
    for tick in range(scenario.sample_count - 1):
        update, time_s = max(tick * _TICK_UPDATES, 1), tick / SAMPLE_RATE_HZ
        figures = ticks.get(update)
        expected = sense_count + (0 if update in failed else len(order))
        if figures is None or len(figures) != expected:
            raise LogIncompleteError(
                f"The log lacks some of the program's senses and answers at {time_s:.2f} s."
            )
        levels = pilot.answer_senses(figures[:sense_count], time_s)
        answers = zip(order, figures[sense_count:], strict=False)
        if update in failed or any(abs(levels.get(key, 0.0) - n) > ALIKE for key, n in answers):
            raise LogIncompleteError(
                f"At {time_s:.2f} s the program answered otherwise in the game than it does here."
            )
    return pilot


def _ticks(log: GameLog) -> dict[int, list[float]]:
    """Return the figures of each update whose lines are complete, in their order."""
    figures: dict[int, list[float]] = {}
    parts: dict[int, list[int]] = {}
    for line in log.lines:
        if line.kind == "p":
            figures.setdefault(line.update, []).extend(line.figures)
            parts.setdefault(line.update, [line.parts]).append(line.part)
    return {
        update: figures[update]
        for update, (count, *values) in parts.items()
        if values == list(range(1, count + 1))
    }


SLACK: Final = 0.5
"""Tolerance of a block's position at the first sample, besides the distance that it may have
fallen; units."""


def proved_start(
    machine: Machine,
    scenario: Scenario,
    tracked: tuple[str, ...],
    first: Sequence[tuple[int, NDArray[np.float64]] | None],
) -> NDArray[np.bool_]:
    """Return true for reported blocks whose start the first sample proves, (N,).

    Nothing falls faster than freely: a first sample within that distance of the start proves that
    the trial began there.

    Args:
        tracked: Reported blocks, without the cargo.
        first: For each reported block, the cargo last, the late first sample and its position in
            Besiege's components; None if it is not late.
    """
    proved = np.zeros(len(first), dtype=bool)
    if all(sample is None for sample in first):
        return proved
    try:
        roots = _start_roots(machine, scenario, tracked)
    except (MachineNotPlayableError, MachineNotSimulable):
        return proved
    for column, sample in enumerate(first):
        if sample is not None:
            time_s = sample[0] / SAMPLE_RATE_HZ
            reach = SLACK + GRAVITY * time_s**2 / 2
            proved[column] = float(np.linalg.norm(sample[1] - roots[column])) <= reach
    return proved


def _start_roots(
    machine: Machine, scenario: Scenario, tracked: tuple[str, ...]
) -> NDArray[np.float64]:
    """Return the reported blocks' roots at the start, (N, 3), Besiege's components."""
    start = game_start(machine, scenario)
    roots = [
        start.rotation @ np.array(machine.blocks[block].world_from_block.xyz) + start.position
        for block in tracked
    ]
    if scenario.cargo is not None and start.cargo is not None:
        under = np.array([0.0, 0.0, scenario.cargo.size[2] / 2])
        roots.append(np.asarray(start.cargo.position) - under)
    return np.array(roots).reshape(-1, 3)[:, [0, 2, 1]]


ENGINE: Final = "besiege"
READING_VERSION: Final = "1"
"""Version of the conversion of logs to trajectories; rises with every change."""

JOINED_DRIFT: Final = 1.0
"""Change of a block's distance from the starting block beyond which it is detached, units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """All values in a log, at the trajectory's own instants.

    Attributes:
        block_ids: (N,) ids of the tracked blocks.
        positions: (T, N, 3) Besiege's components, units.
        burning: (T, N) bool; False where not reported.
        destroyed: (T, N) bool, true once the game destroyed the block; None if not reported.
        cargo: (T, 3) Besiege's components, units; None without cargo.
        mass: (T,) mass of the cargo; None without cargo.
        of_roots: True if positions are those of the blocks' roots, false for their centres.
        piloting: Senses and commands of a program; None without one.
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
    """Return the trajectory in a run's log.

    Args:
        scenario: Scenario that it was prepared for.
        game: Version of the game.
        mod: Version of the mod that runs the script.

    Raises:
        LogIncompleteError: Something is missing, two lines contradict each other, or the machine's
            program does not repeat its answers in the log.
        ControllerFailed: The machine's program failed.
    """
    tracked = tracked_blocks(machine, scenario)
    presses = require_complete(log, machine, scenario, tracked)
    pilot = piloted_again(log, machine, scenario)
    count = len(tracked) + (scenario.cargo is not None)
    reported = log_samples(log, scenario, count)
    is_known = ~np.isnan(reported[:, :, 0]) if count else np.ones((len(reported), 0), dtype=bool)
    late = proved_start(machine, scenario, tracked, find_first_known(reported, is_known))
    complete, longest = filled(reported, is_known, reported_names(tracked, scenario), late)
    positions = complete[:, : len(tracked), 1:4]
    samples = Samples(
        block_ids=tracked,
        positions=positions,
        burning=latest(reported[:, : len(tracked), 4], is_known[:, : len(tracked)]) > 0.0,
        destroyed=latest(reported[:, : len(tracked), 5], is_known[:, : len(tracked)]) > 0.0,
        cargo=complete[:, -1, 1:4] if scenario.cargo is not None else None,
        mass=complete[:, -1, 4] if scenario.cargo is not None else None,
        piloting=None if pilot is None else pilot.piloting(),
        settings={
            **({} if pilot is None else pilot.settings()),
            "effective_key_presses": presses if pilot is None else len(pilot.holds()),
            "filled_samples": int((~is_known[1:]).any(axis=1).sum()) if count else 0,
            "longest_gap_s": round(longest / SAMPLE_RATE_HZ, 6),
            **level_settings(log),
            "lag": "not told by the log",
            "run": hashlib.sha256(log.run_id.encode()).hexdigest()[:16],
            "log": hashlib.sha256(log.text().encode()).hexdigest()[:16],
        },
    )
    return build_trajectory(samples, machine, scenario, version=f"{game}-{mod}")


def build_trajectory(
    samples: Samples, machine: Machine, scenario: Scenario, *, version: str
) -> Trajectory:
    """Return the trajectory of complete samples.

    The game reports the positions of blocks' roots; a cargo is assumed to be upright.

    Args:
        samples: Reported values.
        version: Versions of game and mod.
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
    """Return the piece of each tracked block, as far as distances show, (T, N).

    From the moment its distance from the first starting block differs by more than `JOINED_DRIFT`
    from that at the start, or the game destroys it, a block is a separate piece.

    Args:
        machine: Machine with the order of the blocks.
        block_ids: (N,) ids of the tracked blocks.
        positions: (T, N, 3) units.
        destroyed: (T, N) true once the game destroyed the block.

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
    distance = np.linalg.norm(positions - positions[:, first : first + 1], axis=2)
    held = np.abs(distance - distance[0]) <= JOINED_DRIFT
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
    """Return centres, (T, N, 3), quaternions, (T, N, 4), and the source of the latter."""
    ids, places = samples.block_ids, _ours(samples.positions)
    placed = initial_quaternions(machine, ids, turn)
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
    """Return the machine's rotations, (T, 3, 3); None if its tracked blocks do not show them."""
    pose = Pose(quaternion=turn)
    built = np.array(
        [pose.point(machine.blocks[block_id].world_from_block.xyz) for block_id in block_ids]
    )
    own = list(machine.blocks).index
    start = next(i for i in block_ids if machine.blocks[i].module.kind == "start")
    return machine_rotations(built.reshape(-1, 3), roots, pieces == own(start))


def _ours(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert positions from Besiege's components to the world frame."""
    return np.asarray(positions[..., [0, 2, 1]])


def logged_trajectory(
    text: str, versions: Mapping[str, Any], machine: Machine, scenario: Scenario
) -> Trajectory:
    """Return the trajectory in the stored log of a trial; the game does not run again.

    Args:
        versions: Versions of the trial: game, mod and run.

    Raises:
        LogIncompleteError: It is incomplete.
    """
    run, game, mod = (str(versions.get(name)) for name in ("run", "game", "mod"))
    lines = GameLog(run)
    lines.read(text)
    return trajectory_of(lines, machine, scenario, game=game, mod=mod)
