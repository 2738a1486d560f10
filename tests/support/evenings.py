"""Evidence without a game: what the stand-in prints of each step, spoiled on demand."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from game_rig import GAMES
from stand_in_game.golden import Run, read_run
from stand_in_game.saving import saved_file

from buildarena_besiege import game_start, prepare_run
from buildarena_besiege.exporting.probes import level_probes
from buildarena_pipeline.evidence import (
    FORMAT,
    STEPS,
    Evidence,
    Measured,
    RunRecord,
    StepRecord,
    Versions,
    judged,
    trial_named,
    write_evidence,
)
from buildarena_pipeline.evidence.document import EngineRecord, Point
from buildarena_pipeline.evidence.reading_runs import StepInputs, figures_of
from buildarena_simulation import simulate

VERSIONS = Versions(buildarena="1", game="1.75-23370", mod="1.4", build="25346", mod_file="1.4")
MEASURED = Measured(pace=1.0, copies=9, longest_copy_s=0.3, longest_pause_s=0.4)
Spoil = Callable[[str], str]


def log_text(run: Run, world: str, spoil: Spoil = str) -> str:
    """All that a run prints, each line spoiled before it gets its check sum."""
    spoiled = Run(
        mark=run.mark,
        lines={update: list(map(spoil, lines)) for update, lines in run.lines.items()},
        last=run.last,
        states=(),
    )
    lines = (line for n in range(1, run.last + 26) for line in spoiled.printed(n, world))
    return "\n".join(lines) + "\n"


@cache
def machine_file(trial_name: str) -> tuple[bytes, Run]:
    """A trial's machine file, and what the stand-in knows of its run."""
    trial = trial_named(trial_name)
    run = prepare_run(trial.machine, trial.scenario, name="evening", run_id="run1")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "evening.bsg"
        file.write_bytes(run.machine_file)
        return run.machine_file, read_run(file, GAMES)


@cache
def engine_record(trial_name: str) -> EngineRecord:
    trial = trial_named(trial_name)
    start = game_start(trial.machine, trial.scenario)
    trajectory = simulate(trial.machine, trial.scenario, "mujoco", start=start)
    return EngineRecord(simulation="7", figures=figures_of(trial, trial.machine, trajectory))


def step_inputs(
    name: str,
    *,
    gravity: float = 32.81,
    ground: Callable[[float], float] = lambda height: height,
    spoil: Spoil = str,
    measured: Measured = MEASURED,
    engines: Mapping[str, EngineRecord] | None = None,
    saved: Callable[[bytes], bytes] = lambda data: saved_file(data, "saved"),
) -> StepInputs:
    """What a step was judged by, in a game that behaves, or does not."""
    step = STEPS[name]
    record = StepRecord(name=name, state="done")
    if step.way == "examine":
        points = (Point(name="versions", ok=True, detail="besiege"),)
        return inputs_of(record.model_copy(update={"points": points}), {})
    trial = trial_named(step.trial or "probe")
    data, run = machine_file(trial.name)
    heights = [ground(probe.height) for probe in level_probes(trial.scenario)]
    world = ",".join([f"w,-{gravity:.4f},0,1280,800", *(f"{height:.4f}" for height in heights)])
    files = {"machine-1.bsg": data, "log-1.txt": log_text(run, world, spoil).encode()}
    if step.way == "save":
        files["saved-1.bsg"] = saved(data)
    if step.beside_engines and engines is None:
        engines = {"mujoco": engine_record(trial.name)}
    runs = (RunRecord(number=1, run_id="run1", measured=measured),)
    return inputs_of(
        record.model_copy(update={"runs": runs, "engines": dict(engines or {})}), files
    )


def inputs_of(record: StepRecord, files: Mapping[str, bytes]) -> StepInputs:
    return StepInputs(record=record, files=files, versions=VERSIONS)


def evening(inputs: Iterable[StepInputs]) -> tuple[Evidence, dict[str, bytes]]:
    """Evidence of some steps, and its files."""
    steps = list(inputs)
    evidence = Evidence(
        format=FORMAT,
        made_at=datetime(2026, 11, 25, tzinfo=UTC),
        versions=VERSIONS,
        driver="window",
        screen=(1280, 800),
        steps=tuple(map(judged, steps)),
    )
    files = {
        f"steps/{step.record.name}/{name}": data
        for step in steps
        for name, data in step.files.items()
    }
    return evidence, files


def packed(*names: str) -> bytes:
    """A file of evidence."""
    return write_evidence(*evening(step_inputs(name) for name in names))


def repacked(data: bytes, change: Callable[[dict[str, bytes]], Any], **more: Any) -> bytes:
    """The same file with its members changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", more.get("method", zipfile.ZIP_DEFLATED)) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return made.getvalue()
