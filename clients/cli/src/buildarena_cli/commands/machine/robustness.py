"""`buildarena machine simulate --repeat N`: one machine's trial, many times."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from buildarena_cli.machines import progress_bar
from buildarena_cli.terminal.output import emphasised, print_json, print_table

if TYPE_CHECKING:
    from buildarena_benchmark import Robustness, Task
    from buildarena_geometry import Machine


def show_robustness(
    task: Task, machine: Machine, engine: str, trials: int, *, as_json: bool
) -> None:
    """Repeats a trial with the starts of seeds 0, 1, … and prints how it goes.

    Args:
        task: The task.
        machine: What is tried.
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
    print_table(("figure", "value"), rows, title=emphasised(f"{task.title} on {engine}"))
