"""Leaderboards on a terminal: an overview, and the details of a task."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from buildarena_cli.terminal.output import NOTHING, in_words, number, print_line, print_rows

if TYPE_CHECKING:
    from buildarena_client.schemas import Board, TaskBoard

Columns = Mapping[str, Callable[[Mapping[str, Any]], str]]
"""By heading, what a column shows of the API's row."""


def _spread(row: Mapping[str, Any]) -> str:
    low, high = row["indicator_low"], row["indicator_high"]
    if row["too_few_data"]:
        return "too few"
    return NOTHING if low is None else f"{number(low)}-{number(high)}"


def _share(rate: float | None) -> str:
    return NOTHING if rate is None else f"{100 * rate:.1f} %"


def _interval(low: float | None, high: float | None) -> str:
    return NOTHING if low is None or high is None else f"{100 * low:.0f}-{100 * high:.0f} %"


RESULTS: Columns = {
    "#": lambda row: number(row["rank"], 0),
    "model": lambda row: row["label"] + "*" * row["baseline"] + "†" * bool(row["ran_on_runner"]),
    "success": lambda row: f"{row['successes']:g}/{row['counted']}",
    "95 %": lambda row: _interval(row["success_low"], row["success_high"]),
    "indicator": lambda row: number(row["indicator_mean"], at_least=row["censored"] > 0),
}
DETAILS: Columns = {
    "of it 95 %": _spread,
    "score": lambda row: number(row["score"], 2),
    "best": lambda row: number(row["indicator_best"], at_least=row["censored"] > 0),
    "parts": lambda row: number(row["parts_mean"]),
    "tests": lambda row: number(row["test_trials_mean"]),
    "requests": lambda row: number(row["requests_mean"], 0),
    "tokens": lambda row: number(row["output_tokens_mean"], 0),
    "USD": lambda row: number(row["cost_usd_mean"], 2),
}
OVERALL: Columns = {
    "#": lambda row: number(row["rank"], 0),
    "model": lambda row: row["label"] + "*" * row["baseline"],
    "place": lambda row: f"{row['rank_low']}-{row['rank_high']}" if row["rank"] else "",
    "mean rank": lambda row: number(row["mean_rank"], 2),
    "score": lambda row: number(row["score_mean"], 2),
    "success": lambda row: _share(row["success_rate_mean"]),
    "95 %": lambda row: _interval(row["success_low"], row["success_high"]),
    "USD": lambda row: number(row["cost_usd_mean"], 2),
    "front": lambda row: "+" * row["pareto"],
}


def overview(board: Board) -> None:
    """Print each model's success with its interval and indicator on each task."""
    rows = [{**row, "task": task["task"]} for task in board["tasks"] for row in task["rows"]]
    print_line()
    print_rows({"task": lambda row: row["task"], **RESULTS}, rows)
    _print_legend(board, board["tasks"])


def task_table(board: Board, task: TaskBoard) -> None:
    """Print all models on one task."""
    print_line()
    notes = [
        "of it 95 %: the interval of the mean indicator",
        "too few: with so few successes no interval of the mean indicator holds",
    ]
    print_rows({**RESULTS, **DETAILS}, task["rows"], title=task["task"], notes=notes)
    _print_legend(board, [task])


def overall_table(board: Board) -> None:
    """Print the ranking over all ranked tasks."""
    ranked = board["ranked"]
    is_complete = len(ranked) in (0, len(board["tasks"]))
    print_line()
    print_rows(
        OVERALL,
        board["overall"],
        title="All tasks together" if is_complete else f"Over {', '.join(ranked)}",
        notes=[
            "# is shared by statistically tied models; place: its 95 % interval",
            "+ no other model is both better and cheaper",
            "custom tasks count when asked for",
        ],
    )


def _print_legend(board: Board, tasks: list[TaskBoard]) -> None:
    """Print the indicators by tasks, and what marks and flags mean."""
    indicators, flags = defaultdict(list), Counter[str]()
    rows = [row for task in tasks for row in task["rows"]]
    for task in tasks:
        indicators[in_words(task["indicator"], task["unit"])].append(task["task"])
    for row in rows:
        flags.update(row["flags"])
    print_line("\nSuccesses of jobs, the rate's exact 95 % interval, and the mean indicator:")
    for indicator, names in indicators.items():
        print_line(f"  {', '.join(names)}: {indicator}")
    print_line("* baseline, which has no rank; # is shared by statistically tied models")
    if any(row["censored"] for row in rows):
        print_line("≥ cargos that never fell may weigh more")
    if flags:
        print_line(
            "flags: " + ", ".join(f"{count} {flag}" for flag, count in sorted(flags.items()))
        )
    for flag in board["flags"]:
        if flags[flag["name"]]:
            print_line(f"  {flag['name']}: {flag['meaning']}")
    ran_on_runner, unverified, refuted = (
        sum(row[name] for row in rows) for name in ("ran_on_runner", "unverified", "refuted")
    )
    if ran_on_runner:
        print_line(f"† with trials by a runner: {ran_on_runner} jobs")
    if unverified:
        print_line(
            f"{unverified - refuted} wait for their verification, {refuted} were refuted: "
            "they count nowhere"
        )
