"""Leaderboards on a terminal: an overview, and the details of a task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from buildarena_cli.terminal.output import NOTHING, emphasised, in_words, number, print_table, say

ROW: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "#": lambda row: _rank(row["rank"]),
    "model": lambda row: row["label"] + _marks(row),
    "success": lambda row: f"{row['successes']:g}/{row['counted']}",
    "95 %": lambda row: _interval(row["success_low"], row["success_high"]),
    "indicator": lambda row: number(row["indicator_mean"], at_least=_is_censored(row)),
    "of it 95 %": lambda row: _spread(
        row["indicator_low"], row["indicator_high"], too_few=row["too_few_data"]
    ),
    "score": lambda row: number(row.get("score"), 2),
    "best": lambda row: number(row["indicator_best"], at_least=_is_censored(row)),
    "parts": lambda row: number(row.get("parts_mean")),
    "requests": lambda row: number(row["requests_mean"], 0),
    "tokens": lambda row: number(row["output_tokens_mean"], 0),
    "USD": lambda row: number(row["cost_usd_mean"], 2),
}
"""The columns of a row on a task: what each shows of the API's answer."""
RESULTS = ("#", "model", "success", "95 %", "indicator")
OVERALL = ("#", "model", "place", "mean rank", "score", "success", "USD", "front")


def overview(board: Mapping[str, Any]) -> None:
    """Print each model's success with its interval and indicator on each task.

    Args:
        board: The API's answer.
    """
    print_table(
        ("task", *RESULTS),
        [
            (task["task"], *(ROW[name](row) for name in RESULTS))
            for task in board["tasks"]
            for row in task["rows"]
        ],
        numeric=("#", "success", "95 %", "indicator"),
    )
    say()
    for text in _legend(board):
        say(text)


def task_table(task: Mapping[str, Any]) -> None:
    """Print all models on one task."""
    print_table(
        list(ROW),
        [[shown(row) for shown in ROW.values()] for row in task["rows"]],
        numeric=[name for name in ROW if name != "model"],
        title=emphasised(f"{task['task']}: {in_words(task['indicator'], task['unit'])}"),
        notes=[
            "* baseline; # is shared by statistically tied models",
            "95 % is the exact interval of the success rate, and the one of the mean indicator",
            "too few: with so few successes no interval of the mean indicator holds",
            *_remarks(task["rows"]),
            *_of_runners(task["rows"]),
        ],
    )


def overall_table(board: Mapping[str, Any]) -> None:
    """Print the ranking over all ranked tasks."""
    rows, ranked = [], board.get("ranked") or []
    is_complete = len(ranked) in (0, len(board["tasks"]))
    scope = "All tasks together" if is_complete else f"Over {', '.join(ranked)}"
    for row in board["overall"]:
        rate, placed = row["success_rate_mean"], row["rank"] is not None
        rows.append(
            (
                _rank(row["rank"]),
                row["label"] + ("*" if row["baseline"] else ""),
                f"{row['rank_low']}-{row['rank_high']}" if placed else "",
                number(row["mean_rank"], 2),
                number(row.get("score_mean"), 2),
                "" if rate is None else f"{100 * rate:.1f} %",
                number(row["cost_usd_mean"], 2),
                "+" if row["pareto"] else "",
            )
        )
    print_table(
        OVERALL,
        rows,
        numeric=("#", "place", "mean rank", "score", "success", "USD"),
        title=emphasised(scope),
        notes=[
            "# is shared by statistically tied models; place: its 95 % interval",
            "+ no other model is both better and cheaper",
            "custom tasks count when asked for",
        ],
    )


def _spread(low: float | None, high: float | None, *, too_few: bool) -> str:
    if too_few:
        return "too few"
    return NOTHING if low is None else f"{number(low)}-{number(high)}"


def _is_censored(row: Mapping[str, Any]) -> bool:
    """Return whether figures are lower bounds."""
    return bool(row.get("censored"))


def _rank(rank: int | None) -> str:
    return NOTHING if rank is None else str(rank)


def _interval(low: float | None, high: float | None) -> str:
    return NOTHING if low is None or high is None else f"{100 * low:.0f}-{100 * high:.0f} %"


def _legend(board: Mapping[str, Any]) -> list[str]:
    """Return the legend: the indicators by tasks, and the marks."""
    indicators: dict[str, list[str]] = {}
    for task in board["tasks"]:
        name = in_words(task["indicator"], task["unit"])
        indicators.setdefault(name, []).append(task["task"])
    rows = [row for task in board["tasks"] for row in task["rows"]]
    return [
        "Successes of jobs, the rate's exact 95 % interval, and the mean indicator:",
        *(f"  {', '.join(tasks)}: {name}" for name, tasks in indicators.items()),
        "* baseline; # is shared by statistically tied models",
        *_remarks(rows),
        *_meanings(board, rows),
        *_of_runners(rows),
    ]


def _marks(row: Mapping[str, Any]) -> str:
    return ("*" if row.get("baseline") else "") + ("†" if row.get("ran_on_runner") else "")


def _remarks(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines about flags, if there are any."""
    remarks = []
    if any(map(_is_censored, rows)):
        remarks.append("≥ cargos that never fell may weigh more")
    counts = _flags(rows)
    if counts:
        remarks.append("flags: " + ", ".join(f"{n} {flag}" for flag, n in sorted(counts.items())))
    return remarks


def _flags(rows: Sequence[Mapping[str, Any]]) -> Counter[str]:
    counts: Counter[str] = Counter()
    for row in rows:
        counts.update(row.get("flags", {}))
    return counts


def _meanings(board: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the meanings of the board's flags."""
    counts = _flags(rows)
    return [
        f"  {flag['name']}: {flag['meaning']}" for flag in board["flags"] if counts[flag["name"]]
    ]


def _of_runners(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the legend of runners' results, if there are any."""
    ran_on_runner, unverified, refuted = (
        sum(row[name] for row in rows) for name in ("ran_on_runner", "unverified", "refuted")
    )
    remarks = []
    if ran_on_runner:
        remarks.append(f"† with trials by a runner: {ran_on_runner} jobs")
    if unverified:
        remarks.append(
            f"{unverified - refuted} wait for their verification, {refuted} were refuted: "
            "they count nowhere"
        )
    return remarks
