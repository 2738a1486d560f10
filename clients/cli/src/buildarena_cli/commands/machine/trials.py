"""`buildarena machine simulate`: local trials, without a server."""

from __future__ import annotations

import csv
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.errors import CommandError, did_you_mean
from buildarena_cli.machines import (
    DialectOption,
    MachineFile,
    controlled,
    film,
    progress_bar,
    read_imported,
    report_errors,
    resolve_task,
)
from buildarena_cli.options import to_read
from buildarena_cli.terminal.output import number, print_json, print_table, warn

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from buildarena_benchmark import Robustness, Score, Task
    from buildarena_besiege import ImportedMachine
    from buildarena_geometry import KeyPress, Machine
    from buildarena_simulation import Piloting, Trajectory


def show_robustness(
    task: Task, machine: Machine, engine: str, trials: int, *, as_json: bool
) -> None:
    """Repeat a trial with the starts of seeds 0, 1, … and print the results.

    Args:
        engine: Name of the engine.
        trials: Number of trials.
        as_json: Print JSON instead of a table.
    """
    from buildarena_benchmark import robustness

    with progress_bar() as bar:
        row = bar.add_task(f"{trials} trials on {engine}", total=1.0)
        measured = robustness(
            task,
            machine,
            engine,
            range(trials),
            on_progress=lambda done: bar.update(row, completed=done),
        )
    if as_json:
        print_json(_report(task, engine, measured))
    else:
        _print(task, engine, measured)


def _report(task: Task, engine: str, measured: Robustness) -> dict[str, Any]:
    from buildarena_benchmark.statistics import exact_interval

    trials = len(measured.scores)
    return {
        "task": task.name,
        "task_version": task.version,
        "engine": engine,
        "trials": trials,
        "successes": measured.successes,
        "robustness": measured.share,
        "robustness_interval": list(exact_interval(measured.successes, trials)),
        "indicator_name": task.indicator.name,
        "indicator_unit": task.indicator.unit,
        "results": [
            {
                "seed": seed,
                "success": result.success,
                "indicator": result.indicator,
                "flags": list(result.flags),
            }
            for seed, result in zip(measured.seeds, measured.scores, strict=True)
        ],
    }


def _print(task: Task, engine: str, measured: Robustness) -> None:
    report = _report(task, engine, measured)
    low, high = report["robustness_interval"]
    indicators = [result.indicator for result in measured.scores]
    flags = sorted({flag for result in measured.scores for flag in result.flags})
    failed = [str(r["seed"]) for r in report["results"] if not r["success"]]
    unit = task.indicator.suffix
    rows = [
        (
            "robustness",
            f"{measured.successes} of {report['trials']} succeed ({measured.share:.0%})",
        ),
        ("95 % interval", f"{low:.0%} to {high:.0%}"),
        (f"{task.indicator.name}, median", f"{statistics.median(indicators):,.2f}{unit}"),
        ("least and greatest", f"{min(indicators):,.2f} to {max(indicators):,.2f}{unit}"),
        *([("flags", ", ".join(flags))] if flags else []),
        *([("failed seeds", ", ".join(failed))] if failed else []),
    ]
    print_table(("figure", "value"), rows, title=f"{task.title} on {engine}")


TaskName = Annotated[str, typer.Option("--task", help="A built-in task's name, or a task file.")]


def simulate(  # noqa: PLR0917 - the command line passes options by name
    file: MachineFile,
    task: TaskName,
    engine: Annotated[str | None, typer.Option(help="pybullet or mujoco.")] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help="Seed for the perturbed start and for the task's randomized parameters. Without "
            "it, the exact start is simulated."
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            "--repeat",
            help="Simulate this many perturbed starts and report how robust the result is.",
            min=2,
            max=1000,
        ),
    ] = None,
    video: Annotated[
        Path | None, typer.Option(help="Write a film (.mp4, .gif) or six pictures (.png).")
    ] = None,
    trajectory: Annotated[
        Path | None, typer.Option(help="Write the trajectory (.parquet).")
    ] = None,
    trace: Annotated[
        Path | None,
        typer.Option(help="Write the program's inputs and outputs, 25 rows a second (.csv)."),
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option(
            help="A program (.lua) that acts in place of its keys: docs/control.md.",
            callback=to_read,
        ),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(
            "--key-presses",
            help="Play these key presses (JSON list of time, key, hold_for) instead of the "
            "machine's own; keys of a .bsg are those that its file names.",
            callback=to_read,
        ),
    ] = None,
    dialect: DialectOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the score as JSON.")] = False,
) -> None:
    """Simulate a machine in a task's trial and score it."""
    from buildarena_benchmark import broken_constraint, failed_score, score
    from buildarena_simulation import DEFAULT_ENGINE, ENGINES, UnknownEngineError, require_engine

    with report_errors():
        engine = engine or DEFAULT_ENGINE
        try:
            require_engine(engine)
        except UnknownEngineError as error:
            raise CommandError(f"{error}{did_you_mean(engine, ENGINES)}") from error
        options = {
            "--seed": seed,
            "--video": video,
            "--trajectory": trajectory,
            "--trace": trace,
        }
        single = [option for option, value in options.items() if value is not None]
        if seeds is not None and single:
            raise CommandError(f"--repeat makes many trials, {single[0]} is for one; give either")
        chosen, imported = resolve_task(task), read_imported(file, dialect)
        machine, presses = _with_presses(imported, keys, file)
        if controller is not None:
            machine = controlled(machine, controller)
        _require_program(machine, trace)
        broken = broken_constraint(chosen, machine)
        if broken is not None:
            warn(f"not simulated: {broken[0]}: {broken[1]}")
        if seeds is not None:
            show_robustness(chosen, machine, engine, seeds, as_json=as_json)
            return
        rollout = (
            None
            if broken is not None
            else _simulated(machine, chosen, engine, seed=seed, presses=presses)
        )
        if rollout is None:
            result = failed_score(chosen, machine)
        else:
            result = score(chosen, machine, rollout)
            _write_files(machine, chosen, rollout, trajectory=trajectory, trace=trace, video=video)
        if as_json:
            print_json(score_report(chosen, result, rollout))
        else:
            print_score(chosen, result, rollout)


def _require_program(machine: Machine, trace: Path | None) -> None:
    if trace is not None and not machine.controller:
        raise CommandError("--trace is of a program, and the machine has none: --controller")


def _write_files(
    machine: Machine,
    task: Task,
    rollout: Trajectory,
    *,
    trajectory: Path | None,
    trace: Path | None,
    video: Path | None,
) -> None:
    """Write the requested outputs of a trial."""
    from buildarena_simulation import write_trajectory

    if trajectory is not None:
        trajectory.write_bytes(write_trajectory(rollout))
    if trace is not None and rollout.piloting is not None:
        _write_trace(rollout.time_s, rollout.piloting, trace)
    if video is not None:
        film(machine, task, rollout, video)


def _write_trace(time_s: NDArray[np.float64], piloting: Piloting, file: Path) -> None:
    """Write a row for each tick: time, inputs and outputs of the program."""
    with file.open("w", newline="", encoding="utf-8") as out:
        rows = csv.writer(out)
        rows.writerow(["t", *piloting.sense_names, *piloting.action_names])
        for tick in range(len(time_s) - 1):
            values = [*piloting.senses[tick].tolist(), *piloting.answers[tick].tolist()]
            rows.writerow([f"{value:.6g}" for value in (float(time_s[tick]), *values)])


def _with_presses(
    imported: ImportedMachine, keys: Path | None, file: Path
) -> tuple[Machine, Sequence[KeyPress] | None]:
    """Return the machine with the keys of its file, and the key presses to play instead."""
    from buildarena_besiege import lines_of_keys, read_presses, remap_keys

    for remark in imported.not_understood:
        warn(f"{file}: {remark}")
    if keys is None:
        return imported.machine, None
    for line in lines_of_keys(imported):
        warn(line)
    machine, own = remap_keys(imported)
    try:
        data = keys.read_bytes()
    except OSError as error:
        raise CommandError(f"{keys}: {error.strerror or error}") from error
    return machine, read_presses(data, where=str(keys), keys=own)


def _simulated(
    machine: Machine,
    task: Task,
    engine: str,
    *,
    seed: int | None,
    presses: Sequence[KeyPress] | None,
) -> Trajectory | None:
    from buildarena_simulation import MachineNotSimulable
    from buildarena_simulation import simulate as simulate_here

    with progress_bar() as bar:
        row = bar.add_task(f"simulating on {engine}", total=1.0)
        try:
            return simulate_here(
                machine,
                task.scenario,
                engine,
                seed=seed,
                controls=presses,
                on_progress=lambda done: bar.update(row, completed=done),
            )
        except MachineNotSimulable as failure:
            warn(f"not simulated: {failure.reason}")
            return None


def score_report(task: Task, result: Score, rollout: Trajectory | None) -> dict[str, Any]:
    """Return a trial's score as JSON values."""
    from buildarena_benchmark.flags import is_censored

    return {
        "task": task.name,
        "task_version": task.version,
        "engine": rollout.engine if rollout else None,
        "engine_version": rollout.engine_version if rollout else None,
        "simulation_version": rollout.simulation_version if rollout else None,
        "success": result.success,
        "indicator": result.indicator,
        "indicator_name": task.indicator.name,
        "indicator_unit": task.indicator.unit,
        "censored": is_censored(result.flags),
        "flags": list(result.flags),
        "metrics": dict(result.metrics),
        "breaks": [
            {"time_s": event.time_s, "joint": event.joint, "kind": event.kind}
            for event in (rollout.breaks if rollout else ())
        ],
    }


def print_score(task: Task, result: Score, rollout: Trajectory | None) -> None:
    """Print a trial's score as a table."""
    engine = f" on {rollout.engine} {rollout.engine_version}" if rollout else ""
    from buildarena_benchmark.flags import is_censored, meaning

    rows = [
        ("verdict", "success" if result.success else "failure"),
        (
            task.indicator.name,
            number(result.indicator, 2, at_least=is_censored(result.flags)) + task.indicator.suffix,
        ),
        *(("flag", f"{flag}: {meaning(flag)}") for flag in result.flags),
        *((name, "" if value is None else str(value)) for name, value in result.metrics.items()),
    ]
    print_table(("figure", "value"), rows, title=f"{task.title}{engine}")
