"""What a report says: from a sweep's ended jobs to tables and plots beside the paper's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from buildarena_benchmark.flags import ScoringPolicy, is_disqualified, is_left_out, meaning
from buildarena_benchmark.leaderboard import Board, BoardQuery, Cell, TrackBoard, failure_rows
from buildarena_benchmark.leaderboard.columns import BEST, INDICATOR, PARTS, SUCCESS
from buildarena_benchmark.statistics import MIN_SUCCESSES
from buildarena_cli.report.custom_tasks import custom_tasks
from buildarena_cli.report.document import Block, Grid, Heading, Paragraph, Plot
from buildarena_cli.report.effort import cost, power, rounds, simulators
from buildarena_cli.report.material import (
    Material,
    between,
    indicator_between,
    paper_rows,
    percent,
)
from buildarena_cli.report.plots import indicator_plot, radar_plot, shares_plot, success_plot
from buildarena_cli.terminal.output import number

READ: Final[Mapping[ScoringPolicy, str]] = {
    ScoringPolicy.OURS: "Disqualified jobs count as failures with an indicator of 0.",
    ScoringPolicy.PUBLISHED: "Jobs that the published evaluation calls hacked are left out, "
    "as it leaves them out itself.",
}
"""What each policy does with flags."""


def sections(material: Material) -> list[Block]:
    """The whole report."""
    blocks: list[Block] = [Heading(text=material.title, level=1), _opening(material)]
    if not any(trial.scored for trial in material.trials):
        return [*blocks, *_failures(material, {}), Paragraph(text="No job was scored.")]
    tasks = material.tasks.values()
    track_board = TrackBoard(
        {task.name: task.version for task in tasks},
        {task.name: task.difficulty for task in tasks if task.difficulty},
    )
    for trial in material.trials:
        track_board.put(trial)
    board = track_board.board(BoardQuery(policy=material.policy))
    cells = {task.task: [row.cell for row in task.rows] for task in board.tasks}
    return [
        *blocks,
        *custom_tasks(material, board),
        *_overall(board),
        *_performance(board, cells, material),
        *_flags(cells, material.policy),
        *_dimensions(board),
        *_failures(material, cells),
        *cost(material, cells),
        *rounds(material),
        *simulators(material),
        *power(cells),
    ]


def _opening(material: Material) -> Paragraph:
    outcomes = Counter(trial.outcome for trial in material.trials)
    text = f"{len(material.trials):,} jobs have ended"
    if outcomes:
        text += f": {', '.join(f'{n:,} {name}' for name, n in sorted(outcomes.items()))}"
    if material.unfinished:
        text += f". {material.unfinished:,} have not ended yet, and are not in this report"
    return Paragraph(
        text=f"{text}. Averages are over scored jobs; errored and cancelled jobs are left out and "
        f"counted beside. {READ[material.policy]} The paper's figures were measured in the "
        "game itself: they are a reference and are never ranked with ours."
    )


def _overall(board: Board) -> list[Block]:
    rows = [
        (
            row.model,
            "-" if row.rank is None else str(row.rank),
            "-" if row.rank is None else f"{row.rank_low}-{row.rank_high}",
            number(row.mean_rank, 2),
            number(row.score_mean, 2),
            percent(row.success_rate_mean),
            number(row.cost_usd_mean, 2),
            "yes" if row.pareto else "",
            ", ".join(row.missing),
        )
        for row in board.overall
    ]
    columns = (
        *("model", "rank", "95 % of place", "mean rank", "score"),
        *("success", "USD", "cost front", "lacks"),
    )
    return [
        Heading(text="Ranking"),
        Grid(
            caption="By mean rank over tasks, of success rate and indicator. Statistically tied "
            "models share a rank",
            columns=columns,
            rows=rows,
        ),
    ]


def _performance(
    board: Board, cells: Mapping[str, Sequence[Cell]], material: Material
) -> list[Block]:
    paper = paper_rows(cells, material.snapshots)
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
                    f"{cell.successes:g}/{cell.trials}",
                    f"{cell.successes:g}/{cell.ended}",
                    SUCCESS.text(cell),
                    between(cell.success_low, cell.success_high, 100),
                    SUCCESS.text(reference),
                    INDICATOR.text(cell),
                    indicator_between(cell),
                    number(cell.score, 2),
                    BEST.text(cell),
                    INDICATOR.text(reference),
                    PARTS.text(cell),
                    PARTS.text(reference),
                    str(cell.flagged),
                )
            )
    columns = (
        *("task", "model", "rank", "of scored", "of ended", SUCCESS.heading, "95 %", "paper"),
        *(INDICATOR.heading, "95 %", "score", BEST.heading, "paper"),
        *(PARTS.heading, "paper", "flagged"),
    )
    labels = {
        name: material.tasks[name].figure(material.policy)
        for name in cells
        if name in material.tasks
    }
    return [
        Heading(text="Performance"),
        Grid(
            caption="Success rate and mean indicator with 95 % intervals. Too few data: fewer "
            f"than {MIN_SUCCESSES} successes. ≥: a cargo that never fell may weigh more",
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


def _flags(cells: Mapping[str, Sequence[Cell]], policy: ScoringPolicy) -> list[Block]:
    """Which flags trials have, what they say, and what they do to a rank."""
    rows = [
        (task, cell.model, flag, str(count), _effect(flag, policy), meaning(flag))
        for task, row in cells.items()
        for cell in row
        for flag, count in cell.flags.items()
    ]
    if not rows:
        return []
    columns = "task", "model", "flag", "jobs", "these jobs", "meaning"
    caption = "Scored jobs by flag; a job may have several"
    return [
        Heading(text="Flags"),
        Grid(caption=caption, columns=columns, rows=rows, text_columns=3),
    ]


def _effect(flag: str, policy: ScoringPolicy) -> str:
    if is_left_out([flag], policy):
        return "are left out"
    if policy == ScoringPolicy.OURS and is_disqualified([flag]):
        return "are failures"
    return "count as scored"


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
    # A row of a report is one name, whatever limits its jobs had.
    failures = failure_rows(replace(trial, configuration="") for trial in material.trials)
    outcomes = {row.model: row.outcomes for row in failures}
    refusals = {row.model: row.refusals for row in failures}
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
                    (
                        row.model,
                        f"{row.actions:,}",
                        f"{row.refused_actions:,}",
                        percent(row.refused_actions / row.actions if row.actions else None),
                    )
                    for row in failures
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
