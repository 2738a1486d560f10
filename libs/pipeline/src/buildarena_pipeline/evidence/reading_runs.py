"""The runs of a step, read from its files: what every judgement begins with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from buildarena_benchmark import score
from buildarena_besiege import (
    GameLog,
    LogIncompleteError,
    MachineFileError,
    logged_trajectory,
    read_machine_file,
)
from buildarena_besiege.importing.xml_file import parse_file
from buildarena_besiege.logs.log_lines import World
from buildarena_besiege.tracking import tracked_blocks
from buildarena_geometry import Machine
from buildarena_pipeline.evidence.document import StepRecord, Versions, sentence_of
from buildarena_pipeline.evidence.landings import landing_figures
from buildarena_pipeline.evidence.trials import DROP_CENTER, Trial, is_released, trial_named
from buildarena_simulation import ControllerFailed, Piloting, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ

TIPPED_S: Final = 1.0
"""After which time it is seen which side of a balance sinks, seconds."""
SPUN_S: Final = 1.0
"""How long before a trial's end wheels that a program turns have their speed, seconds."""
REST_S: Final = 0.4
"""How long before a trial's end something that landed counts as at rest, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepInputs:
    """What a step is judged by.

    Attributes:
        record: What the runner noted; its judgements and figures are not read.
        files: The step's files, by their names.
        versions: Of game and mod.
        driver: How the game was driven.
        read: Runs that were read already, by their trial: a judge asks more than once.
    """

    record: StepRecord
    files: Mapping[str, bytes]
    versions: Versions
    driver: str = "window"
    read: dict[str, list[Run]] = field(default_factory=dict, repr=False, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run, as its own files tell it.

    Attributes:
        number: From 1.
        machine: What was played; None where its file cannot be read.
        log: The lines of our script; empty for other drivers.
        trajectory: What the log tells; None where it does not tell enough.
        fault: Why there is no trajectory; "" where there is.
    """

    number: int
    machine: Machine | None
    log: GameLog
    trajectory: Trajectory | None = None
    fault: str = ""
    file: bytes = field(default=b"", repr=False)

    @property
    def world(self) -> World | None:
        """What the script measured of the level."""
        return self.log.world


def runs_of(inputs: StepInputs, trial_name: str) -> list[Run]:
    """The runs of a step, read from its logs and machine files."""
    if trial_name not in inputs.read:
        trial, runs = trial_named(trial_name), inputs.record.runs
        inputs.read[trial_name] = [_run(inputs, trial, run.number, run.run_id) for run in runs]
    return inputs.read[trial_name]


def log_of(inputs: StepInputs, number: int, run_id: str) -> GameLog:
    """The lines of one run."""
    log = GameLog(run_id)
    log.read(_text(inputs, number))
    return log


def figures_of(trial: Trial, machine: Machine, trajectory: Trajectory) -> dict[str, float | None]:
    """What a trial comes to: of the game's trajectory and of an engine's alike.

    Args:
        trial: What the machine was put through.
        machine: The machine.
        trajectory: How it went.
    """
    if trial.task is not None:
        result = score(trial.task, machine, trajectory)
        return {"success": float(result.success), "indicator": round(result.indicator, 4)}
    positions = trajectory.positions.astype(np.float64)
    if is_released(trial.scenario):
        height = positions[:, :, 2].mean(axis=1)
        rest = float(height[-round(REST_S * SAMPLE_RATE_HZ) :].mean())
        landed = landing_figures(trajectory.time_s, height, lost_below=-1.0)
        return {
            "fall_acceleration": _acceleration(trajectory.time_s, height),
            "rest": round(rest, 3),
            **{name: landed[name] for name in ("contact_s", "peak", "peak_s")},
        }
    if trial.name == "scales":
        moved = positions[round(TIPPED_S * SAMPLE_RATE_HZ), 1:3, 2] - positions[0, 1:3, 2]
        return {"against_3": round(float(moved[0]), 3), "against_4": round(float(moved[1]), 3)}
    if trajectory.piloting is not None:
        return _spins(trajectory.piloting)
    way = np.linalg.norm(positions[:, 0, :2] - positions[0, 0, :2], axis=1)
    seconds = range(2, int(trial.scenario.duration_s) + 1, 2)
    return {f"way_{second}_s": round(float(way[second * SAMPLE_RATE_HZ]), 3) for second in seconds}


def root_offsets(run: Run, trial: Trial) -> Iterator[tuple[str, float]]:
    """How far each reported block is from its root in the file, seen from the first: units.

    Yields:
        The module's name, and the distance in the first sample.
    """
    named = trial.scenario.tracked_blocks
    if run.machine is None or (named != "all" and not set(named) <= set(run.machine.blocks)):
        return
    file = parse_file(run.file)
    order = [part.id for part in run.machine.state.parts]
    tracked = tracked_blocks(run.machine, trial.scenario)
    samples = [line for line in run.log.lines if line.kind == "s"]
    first = min((line.update for line in samples), default=0)
    entries = {n: e for line in samples if line.update == first for n, e in line.entries}
    if 1 not in entries or len(file.blocks) < len(order):
        return
    placed = {name: np.array(file.blocks[order.index(name)].position) for name in tracked}
    start_seen = np.array(entries[1].position)
    for number, name in enumerate(tracked, 1):
        if number in entries:
            seen = np.array(entries[number].position) - start_seen
            away = float(np.linalg.norm(seen - (placed[name] - placed[tracked[0]])))
            yield run.machine.blocks[name].module.name, away


def _run(inputs: StepInputs, trial: Trial, number: int, run_id: str) -> Run:
    file = inputs.files.get(f"machine-{number}.bsg", b"")
    log = log_of(inputs, number, run_id)
    try:
        machine = read_machine_file(file).machine
    except MachineFileError as error:
        return Run(number=number, machine=None, log=log, fault=sentence_of(error))
    versions = {
        "run": run_id,
        "game": inputs.versions.game,
        "mod": inputs.versions.mod,
        "desktop": inputs.driver,
        "driver": inputs.driver,
    }
    fault, trajectory = "", None
    try:
        trajectory = logged_trajectory(_text(inputs, number), versions, machine, trial.scenario)
    except (LogIncompleteError, ControllerFailed, ValueError) as error:
        fault = sentence_of(error)
    return Run(
        number=number, machine=machine, log=log, trajectory=trajectory, fault=fault, file=file
    )


def _text(inputs: StepInputs, number: int) -> str:
    return inputs.files.get(f"log-{number}.txt", b"").decode("utf-8", "replace")


def _spins(piloting: Piloting) -> dict[str, float | None]:
    """How fast the wheels turn that a program asks for all and for half of their speed, rad/s."""
    speeds = [at for at, name in enumerate(piloting.sense_names) if name.endswith(".speed")]
    last = piloting.senses[-1 - round(SPUN_S * SAMPLE_RATE_HZ) : -1, speeds].mean(axis=0)
    return {
        name: round(float(speed), 3) for name, speed in zip(("whole", "half"), last, strict=True)
    }


def _acceleration(time_s: np.ndarray, height: np.ndarray) -> float | None:
    """Of a fall, units/s²: of the part between a tenth of a unit and half the way."""
    falling = (height < height[0] - 0.1) & (height > DROP_CENTER / 2)
    falling &= np.arange(len(height)) < int(height.argmin())
    if falling.sum() < 5:  # noqa: PLR2004 - a parabola through fewer points says nothing
        return None
    return round(float(-2 * np.polyfit(time_s[falling], height[falling], 2)[0]), 2)
