"""Writes tests/data/besiege-games.zip: what the game says of the runs that tests play.

`make generate NAME=games`, after an intended change of tasks, exports or physics.
The run's own script is run in a real Lua, its blocks moved by the engine's trajectory; the stand-in
game says these lines again under the id of the run that it plays.
"""

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from support.game.game_rig import (
    GAMES,
    PROGRAMS,
    STILL,
    TRIALS,
    experts_machine,
    piloted_trial,
    short_trial,
    tried_machine,
)
from support.lua_game import LuaGame, references_of

from buildarena_benchmark import builtin_tasks, paper_tasks
from buildarena_besiege import GameLog, game_start
from buildarena_besiege.exporting.probes import height_at
from buildarena_besiege.names import CARGO_ID
from buildarena_besiege.run import PreparedMachine, marked, prepared_machine
from buildarena_geometry import Machine
from buildarena_geometry.besiege_components import besiege_point, besiege_turn
from buildarena_geometry.rotations import multiply
from buildarena_simulation import Scenario, Trajectory, simulate
from buildarena_simulation.engines.base import rotation_of

RUN = "golden"
UPDATES_PER_SAMPLE = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A run as the engine has it, in the game's terms."""

    prepared: PreparedMachine
    trajectory: Trajectory
    rotation: np.ndarray
    position: np.ndarray
    cargo_height: float

    def root(self, number: int, sample: int) -> tuple[float, float, float]:
        """Where the file's block of this number is, Besiege's components."""
        record, told = self.prepared.records[number], self.trajectory
        if record.part == CARGO_ID:
            lifted = rotation_of(told.cargo_quaternion[sample]) @ [0.0, 0.0, self.cargo_height / 2]
            return besiege_point(told.cargo_position[sample] - lifted)
        column = self._column(record.part)
        built = self.rotation @ np.array(besiege_point(record.position)) + self.position
        turned = rotation_of(told.quaternions[sample, column]) @ self._began(column)
        moved = turned @ (built - told.positions[0, column])
        return besiege_point(told.positions[sample, column] + moved)

    def turn(self, number: int, sample: int) -> tuple[float, ...]:
        """How that block is turned, (w, x, y, z) in Besiege's components."""
        if self.prepared.records[number].part == CARGO_ID:
            of_cargo = besiege_turn(_plain(self.trajectory.cargo_quaternion[sample]))
            return multiply(of_cargo, self.prepared.records[number].rotation)
        column = self._column(self.prepared.records[number].part)
        turned = rotation_of(self.trajectory.quaternions[sample, column]) @ self._began(column)
        back = self.prepared.records[number].rotation
        return multiply(besiege_turn(_quaternion(turned @ self.rotation)), back)

    def burns(self, number: int, sample: int) -> bool:
        """Whether that block is a cannon that burns."""
        part, hot = self.prepared.records[number].part, self.trajectory.cannon_ids
        return part in hot and bool(self.trajectory.heated[sample, hot.index(part)])

    def _column(self, part: str) -> int:
        # A connector moves with the starting block: nobody reads where it is.
        ids = self.trajectory.block_ids
        return ids.index(part) if part in ids else 0

    def _began(self, column: int) -> np.ndarray:
        return rotation_of(self.trajectory.quaternions[0, column]).T


def recorded(machine: Machine, scenario: Scenario, moved_as: Machine | None = None) -> Recorded:
    """Simulates a run from the place where the game puts the machine.

    Args:
        machine: The machine.
        scenario: What it is put through.
        moved_as: The same machine with the program that moves it; its own if left out.
    """
    moved_as = moved_as or machine
    start = game_start(machine, scenario)
    whole = scenario.model_copy(update={"tracked_blocks": "all"})
    return Recorded(
        prepared=prepared_machine(machine, scenario, run_id=RUN),
        # A program is told of blocks that the scenario's log leaves out.
        trajectory=simulate(moved_as, whole, "mujoco", start=start),
        rotation=np.array(start.rotation),
        position=np.array(start.position),
        cargo_height=0.0 if scenario.cargo is None else scenario.cargo.size[2],
    )


def between(told: Callable[[int, int], tuple[float, ...]], samples: int) -> Any:
    """Where, or how, a block is at an update: between the trajectory's samples in a line."""

    def at(number: int, update: int) -> Any:
        sample, rest = divmod(update, UPDATES_PER_SAMPLE)
        first, second = (np.array(told(number, min(k, samples - 1))) for k in (sample, sample + 1))
        if len(first) == len("wxyz") and first @ second < 0:  # the same turn
            second = -second
        return tuple((first + (second - first) * rest / UPDATES_PER_SAMPLE).tolist())

    return at


def game_of(run: Recorded, scenario: Scenario) -> LuaGame:
    """The run's script, played in a game whose blocks move as the engine has it."""
    smooth = run.prepared.piloted
    samples = scenario.sample_count
    return LuaGame(
        references_of(run.prepared.records),
        version="lua52",
        ground=lambda east, north: height_at(scenario.terrain, east, north),
        path=between(run.root, samples)
        if smooth
        else lambda number, update: run.root(number, update // UPDATES_PER_SAMPLE),
        turn=between(run.turn, samples),
        burning=lambda number, update: run.burns(number, update // UPDATES_PER_SAMPLE),
    ).play(run.prepared.script, round(scenario.duration_s * 100))


def log_lines(run: Recorded, scenario: Scenario) -> Iterator[str]:
    """What the run's script prints, each line once, without the run's mark and the check sum."""
    game = game_of(run, scenario)
    log = GameLog(RUN)
    log.read("\n".join(game.lines))
    for line in log.lines:
        yield line.text.removeprefix(f"{marked(RUN)},").rpartition(",")[0]


def _quaternion(matrix: np.ndarray) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(matrix).as_quat()
    return _plain((w, x, y, z))


def _plain(quaternion: Any) -> tuple[float, float, float, float]:
    w, x, y, z = map(float, quaternion)
    return (w, x, y, z)


def played_runs() -> dict[str, tuple[Machine, Scenario]]:
    """Every run that tests play, by the name of its file."""
    runs = {name: (experts_machine(name), builtin_tasks()[name].scenario) for name in paper_tasks()}
    for name in TRIALS:
        task, machine = short_trial(name)
        runs[f"{name}-short"] = (machine, task.scenario)
    for name in PROGRAMS:
        task, machine = piloted_trial(name)
        runs[f"program-{name}"] = (machine, task.scenario)
    return {**runs, "calibration": tried_machine()}


def main() -> None:
    """Records every run."""
    logs = dict(sorted(said_logs()))
    with zipfile.ZipFile(GAMES, "w") as archive:
        for name, text in logs.items():
            # Without a time in it, so that the same runs give the same bytes.
            entry = zipfile.ZipInfo(f"{name}.log")
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, text, compresslevel=9)


def said_logs() -> Iterator[tuple[str, str]]:
    """What is said of every run, by its name."""
    for name, (machine, scenario) in played_runs().items():
        # No engine has a trajectory of a program that fails: it stands still.
        still = machine.with_controller(STILL) if name == "program-fails" else None
        run = recorded(machine, scenario, still)
        yield name, "\n".join(log_lines(run, scenario)) + "\n"


if __name__ == "__main__":
    main()
