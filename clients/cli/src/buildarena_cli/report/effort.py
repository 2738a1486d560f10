"""A report's sections on effort: cost, closed loops, and what the samples can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from buildarena_benchmark.leaderboard import Cell, cost_bins, counted_trials
from buildarena_benchmark.leaderboard.columns import (
    COST,
    COST_PER_SUCCESS,
    INPUT_TOKENS,
    OUTPUT_TOKENS,
    REQUESTS,
)
from buildarena_benchmark.statistics import agreement, detectable_difference
from buildarena_cli.report.document import Block, Grid, Heading, Paragraph, Plot
from buildarena_cli.report.material import Material, paper_rows, percent
from buildarena_cli.report.plots import cost_plot, rounds_plot
from buildarena_cli.terminal.output import number

SAMPLES = 64
"""The paper's samples of each model on each task."""


def cost(material: Material, cells: Mapping[str, Sequence[Cell]]) -> list[Block]:
    """Tokens, requests and dollars, and whether more of them brought more."""
    paper = paper_rows(cells, material.snapshots)
    compared, own = (INPUT_TOKENS, OUTPUT_TOKENS, REQUESTS), (COST, COST_PER_SUCCESS)
    rows = [
        (
            *(task, cell.model),
            *(
                column.text(shown)
                for column in compared
                for shown in (cell, paper[task].get(cell.model))
            ),
            *(column.text(cell) for column in own),
        )
        for task, row in cells.items()
        for cell in row
    ]
    columns = (
        *("task", "model"),
        *(heading for column in compared for heading in (column.heading, "paper")),
        *(column.heading for column in own),
    )
    blocks: list[Block] = [
        Heading(text="Cost"),
        Grid(caption="Means of scored jobs", columns=columns, rows=rows, text_columns=2),
    ]
    categories = {name: task.category for name, task in material.tasks.items()}
    by_category = cost_bins(material.trials, policy=material.policy, categories=categories)
    if by_category:
        blocks.append(
            Plot(
                name="cost",
                text="Performance, normalised to the best job, by output tokens",
                figure=cost_plot(by_category),
            )
        )
    return blocks


def rounds(material: Material) -> list[Block]:
    """Closed loops: curves of every model and task that had a second round."""
    runs: dict[str, dict[str, list[Sequence[tuple[bool, float]]]]] = {}
    for trial in counted_trials(material.trials, policy=material.policy):
        models = runs.setdefault(trial.task, {})
        models.setdefault(trial.model, []).append(material.rounds[trial.job_id])
    blocks: list[Block] = []
    for task, models in runs.items():
        looped = {model: of_jobs for model, of_jobs in models.items() if max(map(len, of_jobs)) > 1}
        if not looped:
            continue
        longest = max(len(run) for of_jobs in looped.values() for run in of_jobs)
        curves = {
            model: [_after(of_jobs, number_) for number_ in range(1, longest + 1)]
            for model, of_jobs in looped.items()
        }
        known = material.tasks.get(task)
        indicator = known.indicator if known else "indicator"
        blocks += [
            Grid(
                caption=f"{task}: succeeded after so many simulated rounds, and best indicator "
                "so far",
                columns=("model", *(f"round {i}" for i in range(1, longest + 1))),
                rows=[
                    (model, *(f"{percent(rate)} / {value:.1f}" for rate, value in curve))
                    for model, curve in curves.items()
                ],
            ),
            Plot(
                name=f"rounds-{task}",
                text=f"{task}: success and indicator by round",
                figure=rounds_plot(curves, indicator),
            ),
        ]
    return [Heading(text="Closed loop"), *blocks] if blocks else []


def simulators(material: Material) -> list[Block]:
    """How well two simulators agree on the same machines."""
    names = sorted({name for tried in material.verdicts.values() for name in tried})
    rows = []
    for first, second in combinations(names, 2):
        for task in dict.fromkeys(task for task, _ in material.verdicts):
            both = [
                tried
                for (name, _), tried in material.verdicts.items()
                if name == task and first in tried and second in tried
            ]
            agreed = agreement([t[first] for t in both], [t[second] for t in both])
            if agreed is not None:
                kappa, rho = number(agreed.kappa, 2), number(agreed.rank_correlation, 2)
                same = percent(agreed.same_verdict)
                rows.append((task, f"{first}, {second}", str(agreed.trials), same, kappa, rho))
    if not rows:
        return []
    columns = "task", "simulators", "machines", "same verdict", "kappa", "rank correlation"
    caption = "The same machines in two simulators: success (Cohen's kappa), indicator (Spearman)"
    return [
        Heading(text="Agreement of simulators"),
        Grid(caption=caption, columns=columns, rows=rows, text_columns=2),
    ]


def power(cells: Mapping[str, Sequence[Cell]]) -> list[Block]:
    """Which differences these numbers of samples can show."""
    counts = sorted({cell.trials for row in cells.values() for cell in row if cell.trials})
    shown = sorted({counts[0], counts[-1], SAMPLES})
    rows = []
    for rate in (0.05, 0.2, 0.5, 0.8):
        rises = [detectable_difference(rate, trials) for trials in shown]
        rows.append((percent(rate), *("-" if r is None else f"+{100 * r:.0f} %" for r in rises)))
    return [
        Heading(text="What these samples can show"),
        Paragraph(
            text="The smallest rise above a success rate that is found in four of five such "
            "experiments, at an error of 5 %. Smaller differences may be real and stay unseen."
        ),
        Grid(
            caption="By samples of each model on a task",
            columns=("success rate", *(f"{trials} samples" for trials in shown)),
            rows=rows,
        ),
    ]


def _after(runs: Sequence[Sequence[tuple[bool, float]]], rounds: int) -> tuple[float, float]:
    """Of all runs: the share that has succeeded by then, and the mean of their best so far."""
    succeeded = [any(success for success, _ in run[:rounds]) for run in runs]
    best = [max((value for _, value in run[:rounds]), default=0.0) for run in runs]
    return sum(succeeded) / len(runs), sum(best) / len(runs)
