"""What a report says: from a sweep's ended jobs to tables and plots beside the paper's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import (
    Board,
    BoardQuery,
    Cell,
    PublishedRow,
    TrackBoard,
    Trial,
    published_rows,
)
from buildarena_benchmark.statistics import detectable_difference, token_bins
from buildarena_cli.output import in_words, number
from buildarena_cli.report_document import Block, Grid, Heading, Paragraph, Plot
from buildarena_cli.report_plots import (
    cost_plot,
    indicator_plot,
    radar_plot,
    rounds_plot,
    shares_plot,
    success_plot,
)

SAMPLES = 64
"""The paper's samples of each model on each task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What a report is made of.

    Attributes:
        title: What was run.
        trials: Ended jobs; their models are named as rows of the report.
        rounds: Of each job by id, for each round: success and indicator.
        snapshots: The provider's name of each row's model.
        unfinished: Jobs that have not ended.
    """

    title: str
    trials: Sequence[Trial]
    rounds: Mapping[str, Sequence[tuple[bool, float]]]
    snapshots: Mapping[str, str]
    unfinished: int


def sections(material: Material) -> list[Block]:
    """The whole report."""
    blocks: list[Block] = [Heading(text=material.title, level=1), _opening(material)]
    if not any(trial.scored for trial in material.trials):
        return [*blocks, *_failures(material, {}), Paragraph(text="No job was scored.")]
    tasks = builtin_tasks()
    kept = TrackBoard(
        {name: task.version for name, task in tasks.items()},
        {name: task.difficulty for name, task in tasks.items() if task.difficulty},
    )
    for trial in material.trials:
        kept.put(trial)
    board = kept.board(BoardQuery())
    cells = {task.task: [row.cell for row in task.rows] for task in board.tasks}
    return [
        *blocks,
        *_overall(board),
        *_performance(board, cells, material),
        *_dimensions(board),
        *_failures(material, cells),
        *_cost(material, cells),
        *_rounds(material),
        *_power(cells),
    ]


def _opening(material: Material) -> Paragraph:
    outcomes = Counter(trial.outcome for trial in material.trials)
    text = f"{len(material.trials):,} jobs have ended"
    if outcomes:
        text += f": {', '.join(f'{n:,} {name}' for name, n in sorted(outcomes.items()))}"
    if material.unfinished:
        text += f". {material.unfinished:,} have not ended yet, and are not in this report"
    return Paragraph(
        text=f"{text}. Averages are over scored jobs; errored and cancelled jobs and flagged "
        "successes are left out and counted beside. The paper's figures were measured in the "
        "game itself: they are a reference and are never ranked with ours."
    )


def _overall(board: Board) -> list[Block]:
    rows = [
        (
            row.model,
            "-" if row.rank is None else str(row.rank),
            "-" if row.rank is None else f"{row.rank_low}-{row.rank_high}",
            number(row.mean_rank, 2),
            percent(row.success_rate_mean),
            number(row.cost_usd_mean, 2),
            "yes" if row.pareto else "",
            ", ".join(row.missing),
        )
        for row in board.overall
    ]
    columns = "model", "rank", "95 % of place", "mean rank", "success", "USD", "cost front", "lacks"
    return [
        Heading(text="Ranking"),
        Grid(
            caption="By mean rank over tasks, of success rate and indicator. Models that can't "
            "be told apart share a rank",
            columns=columns,
            rows=rows,
        ),
    ]


def _performance(
    board: Board, cells: Mapping[str, Sequence[Cell]], material: Material
) -> list[Block]:
    tasks = builtin_tasks()
    paper = _paper(cells, material.snapshots)
    rows = []
    for task in board.tasks:
        for ranked in task.rows:
            cell = ranked.cell
            reference = paper[task.task].get(cell.model)
            rows.append(
                (
                    task.task,
                    cell.model,
                    "-" if ranked.rank is None else str(ranked.rank),
                    f"{cell.successes}/{cell.trials}",
                    f"{cell.successes}/{cell.ended}",
                    percent(cell.success_rate),
                    between(cell.success_low, cell.success_high, 100),
                    percent(reference.success_rate) if reference else "-",
                    number(cell.indicator_mean),
                    between(cell.indicator_low, cell.indicator_high),
                    number(reference.indicator_mean) if reference else "-",
                    number(cell.parts_mean),
                    number(reference.parts_mean) if reference else "-",
                    str(cell.flagged),
                )
            )
    columns = (
        *("task", "model", "rank", "of scored", "of ended", "success", "95 %", "paper"),
        *("indicator", "95 %", "paper", "parts", "paper", "flagged"),
    )
    labels = {
        name: in_words(tasks[name].indicator.name, tasks[name].indicator.unit)
        for name in cells
        if name in tasks
    }
    return [
        Heading(text="Performance"),
        Grid(
            caption="Success rate with Wilson interval, indicator with bootstrap interval",
            columns=columns,
            rows=rows,
            text_columns=2,
        ),
        Plot(
            name="success",
            text="Success rates with 95 % intervals",
            figure=success_plot(cells, paper),
        ),
        Plot(
            name="indicator",
            text="Mean indicators with 95 % intervals",
            figure=indicator_plot(cells, paper, labels),
        ),
    ]


def _dimensions(board: Board) -> list[Block]:
    ranked = [row for row in board.overall if row.dimensions]
    if not ranked:
        return []
    names = list(ranked[0].dimensions)
    return [
        Heading(text="Difficulty dimensions"),
        Grid(
            caption="Score from 0 (last on every task) to 1 (first), weighted by what the tasks "
            "ask for",
            columns=("model", *names),
            rows=[(r.model, *(f"{r.dimensions[name]:.2f}" for name in names)) for r in ranked],
        ),
        Plot(name="dimensions", text="Scores by difficulty dimension", figure=radar_plot(ranked)),
    ]


def _failures(material: Material, cells: Mapping[str, Sequence[Cell]]) -> list[Block]:
    outcomes: dict[str, Counter[str]] = {}
    refusals: dict[str, Counter[str]] = {}
    actions: dict[str, list[int]] = {}
    for trial in material.trials:
        row = outcomes.setdefault(trial.model, Counter())
        named = trial.outcome if not trial.reason else f"{trial.outcome}: {trial.reason}"
        row[named] += 1
        refusals.setdefault(trial.model, Counter()).update(trial.refusals)
        made = actions.setdefault(trial.model, [0, 0])
        made[0] += trial.actions
        made[1] += trial.refused_actions
    if not outcomes:
        return []
    blocks: list[Block] = [
        Heading(text="Failures"),
        Plot(
            name="outcomes",
            text="Shares of outcomes",
            figure=shares_plot(outcomes, "share of ended jobs"),
        ),
    ]
    if any(sum(counts.values()) for counts in refusals.values()):
        rows = [
            (task, cell.model, name.replace("_", " "), str(count), percent(count / total))
            for task, row_ in cells.items()
            for cell in row_
            if (total := sum(cell.refusals.values()))
            for name, count in sorted(cell.refusals.items(), key=lambda item: -item[1])
        ]
        blocks += [
            Grid(
                caption="Refused actions of all actions",
                columns=("model", "actions", "refused", "invalid-action rate"),
                rows=[
                    (model, f"{n:,}", f"{bad:,}", percent(bad / n if n else None))
                    for model, (n, bad) in actions.items()
                ],
            ),
            Plot(
                name="refusals",
                text="Shares of reasons for refused actions",
                figure=shares_plot(refusals, "share of refused actions"),
            ),
            Grid(
                caption="Reasons for refused actions",
                columns=("task", "model", "reason", "actions", "share"),
                rows=rows,
                text_columns=3,
            ),
        ]
    return blocks


def _cost(material: Material, cells: Mapping[str, Sequence[Cell]]) -> list[Block]:
    paper = _paper(cells, material.snapshots)
    rows = []
    for task, row in cells.items():
        for cell in row:
            reference = paper[task].get(cell.model)
            rows.append(
                (
                    task,
                    cell.model,
                    number(cell.input_tokens_mean, 0),
                    number(reference.input_tokens_mean, 0) if reference else "-",
                    number(cell.output_tokens_mean, 0),
                    number(reference.output_tokens_mean, 0) if reference else "-",
                    number(cell.requests_mean),
                    number(reference.requests_mean) if reference else "-",
                    number(cell.cost_usd_mean, 4),
                    number(cell.cost_per_success_usd, 4),
                )
            )
    columns = (
        *("task", "model", "input tokens", "paper", "output tokens", "paper", "requests"),
        *("paper", "USD", "USD a success"),
    )
    blocks: list[Block] = [
        Heading(text="Cost"),
        Grid(caption="Means of scored jobs", columns=columns, rows=rows, text_columns=2),
    ]
    by_category = _normalised(material.trials)
    if by_category:
        blocks.append(
            Plot(
                name="cost",
                text="Performance, normalised to the best job, by output tokens",
                figure=cost_plot(
                    {
                        category: token_bins(tokens, performance)
                        for category, (tokens, performance) in by_category.items()
                    }
                ),
            )
        )
    return blocks


def _rounds(material: Material) -> list[Block]:
    """Curves of every model and task that had a second round."""
    runs: dict[str, dict[str, list[Sequence[tuple[bool, float]]]]] = {}
    for trial in material.trials:
        if trial.scored:
            models = runs.setdefault(trial.task, {})
            models.setdefault(trial.model, []).append(material.rounds[trial.job_id])
    blocks: list[Block] = []
    for task, models in runs.items():
        looped = {model: found for model, found in models.items() if max(map(len, found)) > 1}
        if not looped:
            continue
        longest = max(len(run) for found in looped.values() for run in found)
        curves = {
            model: [_after(found, number_) for number_ in range(1, longest + 1)]
            for model, found in looped.items()
        }
        known = builtin_tasks().get(task)
        indicator = known.indicator.name if known else "indicator"
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


def _after(runs: Sequence[Sequence[tuple[bool, float]]], rounds: int) -> tuple[float, float]:
    """Of all runs: the share that has succeeded by then, and the mean of their best so far."""
    succeeded = [any(success for success, _ in run[:rounds]) for run in runs]
    best = [max((value for _, value in run[:rounds]), default=0.0) for run in runs]
    return sum(succeeded) / len(runs), sum(best) / len(runs)


def _power(cells: Mapping[str, Sequence[Cell]]) -> list[Block]:
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


def percent(share: float | None) -> str:
    """A share for people."""
    return "-" if share is None else f"{100 * share:.1f} %"


def between(low: float | None, high: float | None, factor: float = 1.0) -> str:
    """An interval for people."""
    if low is None or high is None:
        return "-"
    return f"{factor * low:.1f}-{factor * high:.1f}"


def _paper(
    cells: Mapping[str, Sequence[Cell]], snapshots: Mapping[str, str]
) -> dict[str, dict[str, PublishedRow]]:
    """The paper's rows by task and by the name that the same snapshot has in this report."""
    found: dict[str, dict[str, PublishedRow]] = {}
    for task, row in cells.items():
        by_snapshot = {paper.snapshot: paper for paper in published_rows().get(task, ())}
        names = {cell.model for cell in row}
        found[task] = {
            name: by_snapshot[snapshots[name]]
            for name in names
            if snapshots.get(name) in by_snapshot
        }
    return found


def _normalised(trials: Sequence[Trial]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Output tokens and performance, relative to the best job of the task, by category."""
    tasks = builtin_tasks()
    best: dict[str, float] = {}
    for trial in trials:
        best[trial.task] = max(best.get(trial.task, 0.0), trial.indicator)
    found: dict[str, list[tuple[float, float]]] = {}
    for trial in trials:
        if trial.scored and trial.output_tokens:
            category = tasks[trial.task].category if trial.task in tasks else trial.task
            top = best[trial.task]
            relative = trial.indicator / top if top > 0 else 0.0
            found.setdefault(category, []).append((float(trial.output_tokens), relative))
    return {
        category: (np.array([t for t, _ in pairs]), np.array([p for _, p in pairs]))
        for category, pairs in found.items()
    }
