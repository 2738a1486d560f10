"""Leaderboards on a terminal: one overview, and the details of a task.

The overview has a row for each model and, for each task, success, its interval and the indicator.
On a narrow terminal the tasks are continued below in further blocks, so that none is left out;
where not even one task fits beside the models' names, the intervals give way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from buildarena_cli.terminal.output import (
    NOTHING,
    columns,
    emphasised,
    in_words,
    is_terminal,
    number,
    padded,
    print_lines,
    print_table,
    say,
    terminal_width,
    width_of,
)

GAP = "   "
FIGURES = ("success", "95 %", "indicator", "parts", "requests", "tokens", "USD")
DETAILS = columns(
    *("#", "model", *FIGURES),
    figures=("#", *FIGURES),
    leaving=("requests", "parts", "tokens", "USD", "95 %", "indicator"),
)
PUBLISHED = columns(
    *("model", *FIGURES[:-1]),
    figures=FIGURES,
    leaving=("requests", "parts", "tokens", "95 %", "indicator"),
)
OVERALL = columns(
    *("#", "model", "place", "mean rank", "success", "USD", "front"),
    figures=("#", "place", "mean rank", "success", "USD"),
    leaving=("front", "USD", "mean rank", "place", "success"),
)


def overview(board: Mapping[str, Any], *, published: bool = False) -> None:
    """Prints models x tasks: success with its interval, indicator; and the overall rank.

    Args:
        board: The API's answer.
        published: Whether the paper's figures stand below ours.
    """
    ranks = {(row["model"], row["configuration"]): row["rank"] for row in board["overall"]}
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for task in board["tasks"]:
        for row in task["rows"]:
            key = (row["model"], row["configuration"])
            rows.setdefault(key, {"baseline": row["baseline"]})[task["task"]] = row
    ordered = sorted(rows, key=lambda key: (ranks.get(key) is None, ranks.get(key), key[0]))
    names = [model + ("*" if rows[(model, conf)]["baseline"] else "") for model, conf in ordered]
    _print_blocks(
        [task["task"] for task in board["tasks"]],
        [
            (_rank(ranks.get(key)), name, rows[key])
            for key, name in zip(ordered, names, strict=True)
        ],
    )
    if published:
        say()
        say("As published: measured in the game, never ranked with ours")
        _print_blocks([task["task"] for task in board["tasks"]], _published_rows(board))
    say()
    for text in _legend(board):
        say(text)


def task_table(task: Mapping[str, Any]) -> None:
    """Prints all models on one task."""
    print_table(
        DETAILS,
        [
            (
                _rank(row["rank"]),
                row["model"] + ("*" if row["baseline"] else ""),
                *_figures(row),
                number(row["cost_usd_mean"], 2),
            )
            for row in task["rows"]
        ],
        title=emphasised(f"{task['task']}: {in_words(task['indicator'], task['unit'])}"),
        notes=[
            "* baseline; # is shared by statistically tied models",
            "95 % is the Wilson interval of the success rate",
        ],
    )


def published_table(task: Mapping[str, Any]) -> None:
    """Prints the paper's figures of one task."""
    print_table(
        PUBLISHED,
        [(row["model"], *_figures(row)) for row in task["published"]],
        title=f"{task['task']}, as published: measured in the game, never ranked with ours",
    )


def overall_table(board: Mapping[str, Any]) -> None:
    """Prints the ranking over all tasks."""
    rows = []
    for row in board["overall"]:
        rate, ranked = row["success_rate_mean"], row["rank"] is not None
        rows.append(
            (
                _rank(row["rank"]),
                row["model"] + ("*" if row["baseline"] else ""),
                f"{row['rank_low']}-{row['rank_high']}" if ranked else "",
                number(row["mean_rank"], 2),
                "" if rate is None else f"{100 * rate:.1f} %",
                number(row["cost_usd_mean"], 2),
                "+" if row["pareto"] else "",
            )
        )
    print_table(
        OVERALL,
        rows,
        title=emphasised("All tasks together"),
        notes=[
            "# is shared by statistically tied models; place: its 95 % interval",
            "+ no other model is both better and cheaper",
            "custom tasks count when asked for",
        ],
    )


def _figures(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        f"{row['successes']}/{row['trials']}",
        _interval(row),
        number(row["indicator_mean"]),
        number(row.get("parts_mean")),
        number(row["requests_mean"], 0),
        number(row["output_tokens_mean"], 0),
    )


def _rank(rank: int | None) -> str:
    return NOTHING if rank is None else str(rank)


def _interval(row: Mapping[str, Any]) -> str:
    low, high = row["success_low"], row["success_high"]
    return NOTHING if low is None else f"{100 * low:.0f}-{100 * high:.0f} %"


def _published_rows(board: Mapping[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    rows: dict[str, dict[str, Any]] = {}
    for task in board["tasks"]:
        for row in task["published"]:
            rows.setdefault(row["model"], {})[task["task"]] = row
    ranks = {row["model"]: row["rank"] for row in board["published"]}
    ordered = sorted(rows, key=lambda name: (ranks.get(name) is None, ranks.get(name), name))
    return [(_rank(ranks.get(name)), name, rows[name]) for name in ordered]


def _print_blocks(tasks: Sequence[str], rows: Sequence[tuple[str, str, dict[str, Any]]]) -> None:
    blocks = [_task_block(task, rows, intervals=True) for task in tasks]
    head = _aligned([("#", "model"), *((rank, name) for rank, name, _ in rows)], right=(0,))
    room = terminal_width() if is_terminal() else None
    if room is not None and any(_width([head, block]) > room for block in blocks):
        blocks = [_task_block(task, rows, intervals=False) for task in tasks]
    for number_, group in enumerate(_groups(head, blocks, room)):
        lines = [GAP.join(parts).rstrip() for parts in zip(head, *group, strict=True)]
        print_lines([*([""] if number_ else []), emphasised(lines[0]), *lines[1:]])


def _groups(
    head: list[str], blocks: Sequence[list[str]], room: int | None
) -> Iterator[list[list[str]]]:
    """As many tasks beside each other as there is room for; without a terminal, all."""
    group: list[list[str]] = []
    for block in blocks:
        if group and room is not None and _width([head, *group, block]) > room:
            yield group
            group = []
        group.append(block)
    if group:
        yield group


def _width(blocks: Sequence[list[str]]) -> int:
    return sum(width_of(block[0]) for block in blocks) + len(GAP) * (len(blocks) - 1)


def _task_block(
    task: str, rows: Sequence[tuple[str, str, dict[str, Any]]], *, intervals: bool
) -> list[str]:
    """A task's heading and its cell of each row, all equally wide."""
    cells = []
    for _, _, by_task in rows:
        row = by_task.get(task)
        if row is None:
            cells.append((NOTHING,) * (2 + intervals))
            continue
        rate = f"{row['successes']}/{row['trials']}"
        middle = (_interval(row),) if intervals else ()
        cells.append((rate, *middle, number(row["indicator_mean"])))
    lines = _aligned(cells, right=range(2 + intervals))
    width = max(width_of(line) for line in [task, *lines])
    return [padded(line, width, right=True) for line in [task, *lines]]


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    widths = [max(map(width_of, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            padded(cell, width, right=i in right)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def _legend(board: Mapping[str, Any]) -> list[str]:
    """What the figures are: the indicators by tasks, and the marks."""
    indicators: dict[str, list[str]] = {}
    for task in board["tasks"]:
        name = in_words(task["indicator"], task["unit"])
        indicators.setdefault(name, []).append(task["task"])
    return [
        "Successes of jobs, the rate's 95 % Wilson interval, and the mean indicator:",
        *(f"  {', '.join(tasks)}: {name}" for name, tasks in indicators.items()),
        "* baseline; # is the overall rank, shared by statistically tied models",
    ]
