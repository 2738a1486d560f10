"""`buildarena machine simulate`: local trials, without a server."""

from __future__ import annotations

import csv
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.errors import CommandError, did_you_mean
from buildarena_cli.machines import (
    ControllerOption,
    KeysOption,
    MachineFile,
    TaskOption,
    controlled,
    film,
    progress_bar,
    read_imported,
    report_errors,
    resolve_task,
)
from buildarena_cli.options import JsonOption
from buildarena_cli.terminal.output import number, print_json, print_table, warn

if TYPE_CHECKING:
    from buildarena_benchmark import Score, Task
    from buildarena_geometry import KeyPress, Machine
    from buildarena_simulation import Trajectory


@report_errors()
def simulate(  # noqa: PLR0917 - the command line passes options by name
    file: MachineFile,
    task: TaskOption,
    engine: Annotated[str | None, typer.Option(help="pybullet or mujoco.")] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help="Seed for the perturbed start and for the task's randomized parameters. Without "
            "it, the exact start is simulated."
        ),
    ] = None,
    repeat: Annotated[
        int | None,
        typer.Option(
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
    controller: ControllerOption = None,
    keys: KeysOption = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate a machine in a task's trial and score it."""
    from buildarena_benchmark import broken_constraint, failed_score, score
    from buildarena_simulation import DEFAULT_ENGINE, ENGINES, UnknownEngineError, require_engine

    engine = engine or DEFAULT_ENGINE
    try:
        require_engine(engine)
    except UnknownEngineError as error:
        raise CommandError(f"{error}{did_you_mean(engine, ENGINES)}") from error
    options = {"--seed": seed, "--video": video, "--trajectory": trajectory, "--trace": trace}
    for option, value in options.items():
        if repeat is not None and value is not None:
            raise CommandError(f"--repeat makes many trials, {option} is for one; give either")
    chosen = resolve_task(task)
    machine, presses = _with_presses(file, keys)
    machine = controlled(machine, controller)
    if trace is not None and not machine.controller:
        raise CommandError("--trace is of a program, and the machine has none: --controller")
    broken = broken_constraint(chosen, machine)
    if broken is not None:
        warn(f"not simulated: {broken[0]}: {broken[1]}")
    if repeat is not None:
        _show_robustness(chosen, machine, engine, repeat, as_json=as_json)
        return
    rollout = None if broken else _simulated(machine, chosen, engine, seed, presses)
    if rollout is None:
        result = failed_score(chosen, machine)
    else:
        result = score(chosen, machine, rollout)
        if video is not None:
            film(machine, chosen, rollout, video)
        _write_tables(rollout, trajectory, trace)
    show_score(chosen, result, rollout, as_json=as_json)


def _show_robustness(
    task: Task, machine: Machine, engine: str, trials: int, *, as_json: bool
) -> None:
    """Repeat a trial with the starts of seeds 0, 1, … and print the results."""
    from buildarena_benchmark import robustness
    from buildarena_benchmark.statistics import exact_interval

    with progress_bar(f"{trials} trials on {engine}") as on_progress:
        measured = robustness(task, machine, engine, range(trials), on_progress=on_progress)
    low, high = exact_interval(measured.successes, trials)
    results = [
        {
            "seed": seed,
            "success": result.success,
            "indicator": result.indicator,
            "flags": list(result.flags),
        }
        for seed, result in zip(measured.seeds, measured.scores, strict=True)
    ]
    if as_json:
        print_json(
            {
                **_about(task),
                "engine": engine,
                "trials": trials,
                "successes": measured.successes,
                "robustness": measured.share,
                "robustness_interval": [low, high],
                "results": results,
            }
        )
        return
    indicators = [result.indicator for result in measured.scores]
    flags = sorted({flag for result in measured.scores for flag in result.flags})
    failed = [str(result["seed"]) for result in results if not result["success"]]
    unit = task.indicator.suffix
    rows = [
        ("robustness", f"{measured.successes} of {trials} succeed ({measured.share:.0%})"),
        ("95 % interval", f"{low:.0%} to {high:.0%}"),
        (f"{task.indicator.name}, median", f"{statistics.median(indicators):,.2f}{unit}"),
        ("least and greatest", f"{min(indicators):,.2f} to {max(indicators):,.2f}{unit}"),
        ("flags", ", ".join(flags)),
        ("failed seeds", ", ".join(failed)),
    ]
    print_table(("figure", "value"), rows, title=f"{task.title} on {engine}")


def _about(task: Task) -> dict[str, str]:
    return {
        "task": task.name,
        "task_version": task.version,
        "indicator_name": task.indicator.name,
        "indicator_unit": task.indicator.unit,
    }


def _write_tables(rollout: Trajectory, trajectory: Path | None, trace: Path | None) -> None:
    """Write the trajectory; and a row for each tick: time, inputs and outputs of the program."""
    from buildarena_simulation import write_trajectory

    if trajectory is not None:
        trajectory.write_bytes(write_trajectory(rollout))
    piloting = rollout.piloting
    if trace is None or piloting is None:
        return
    with trace.open("w", newline="", encoding="utf-8") as out:
        rows = csv.writer(out)
        rows.writerow(["t", *piloting.sense_names, *piloting.action_names])
        # The last time is the trial's end, at which no tick begins.
        ticks = zip(rollout.time_s[:-1], piloting.senses, piloting.answers, strict=False)
        for time_s, senses, answers in ticks:
            rows.writerow([f"{value:.6g}" for value in (time_s, *senses, *answers)])


def _with_presses(file: Path, keys: Path | None) -> tuple[Machine, Sequence[KeyPress] | None]:
    """Return the machine with the keys of its file, and the key presses to play instead."""
    from buildarena_besiege import lines_of_keys, read_presses, remap_keys

    imported = read_imported(file)
    if keys is None:
        return imported.machine, None
    for line in lines_of_keys(imported):
        warn(line)
    machine, own = remap_keys(imported)
    return machine, read_presses(keys.read_bytes(), where=str(keys), keys=own)


def _simulated(
    machine: Machine,
    task: Task,
    engine: str,
    seed: int | None,
    presses: Sequence[KeyPress] | None,
) -> Trajectory | None:
    from buildarena_simulation import MachineNotSimulable
    from buildarena_simulation import simulate as simulate_here

    scenario = task.scenario
    with progress_bar(f"simulating on {engine}") as on_progress:
        try:
            return simulate_here(
                machine, scenario, engine, seed=seed, controls=presses, on_progress=on_progress
            )
        except MachineNotSimulable as failure:
            warn(f"not simulated: {failure.reason}")
            return None


def show_score(task: Task, result: Score, rollout: Trajectory | None, *, as_json: bool) -> None:
    """Print a trial's score, as a table or as JSON."""
    from buildarena_benchmark.flags import is_censored, meaning

    if as_json:
        print_json(
            {
                **_about(task),
                "engine": rollout.engine if rollout else None,
                "engine_version": rollout.engine_version if rollout else None,
                "simulation_version": rollout.simulation_version if rollout else None,
                "success": result.success,
                "indicator": result.indicator,
                "censored": is_censored(result.flags),
                "flags": list(result.flags),
                "metrics": dict(result.metrics),
                "breaks": [
                    {"time_s": event.time_s, "joint": event.joint, "kind": event.kind}
                    for event in (rollout.breaks if rollout else ())
                ],
            }
        )
        return
    engine = f" on {rollout.engine} {rollout.engine_version}" if rollout else ""
    indicator = number(result.indicator, 2, at_least=is_censored(result.flags))
    rows = [
        ("verdict", "success" if result.success else "failure"),
        (task.indicator.name, indicator + task.indicator.suffix),
        *(("flag", f"{flag}: {meaning(flag)}") for flag in result.flags),
        *((name, "" if value is None else str(value)) for name, value in result.metrics.items()),
    ]
    print_table(("figure", "value"), rows, title=f"{task.title}{engine}")
