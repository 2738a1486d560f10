"""Leaderboards on a terminal: one overview, and the details of a task.

The overview has success, its interval and the indicator of each model on each task. Through a pipe
there is a row for each model. A terminal gets that, or a row for each task, whichever takes fewer
blocks: what does not fit beside the names is continued below, so that nothing is left out. Where
not even one column fits beside the names, the intervals give way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from buildarena_cli.terminal.output import (
    NOTHING,
    columns,
    emphasised,
    harmless,
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
ROW: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "#": lambda row: _rank(row["rank"]),
    "model": lambda row: _marked([row]),
    "success": lambda row: f"{row['successes']:g}/{row['trials']}",
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
RESULTS = ("success", "95 %", "indicator")
LEAVING = ("requests", "parts", "tokens", "USD", "best", "score", "of it 95 %", "95 %", "indicator")
OVERALL = columns(
    *("#", "model", "place", "mean rank", "score", "success", "USD", "front"),
    numeric=("#", "place", "mean rank", "score", "success", "USD"),
    leaving=("front", "USD", "mean rank", "score", "place", "success"),
)


class _Row(NamedTuple):
    """A model of the overview: its rank, its name, and its row of each task."""

    rank: str
    name: str
    by_task: Mapping[str, Mapping[str, Any]]


def overview(board: Mapping[str, Any]) -> None:
    """Prints models x tasks: success with its interval, indicator; and the overall rank.

    Args:
        board: The API's answer.
    """
    ranks = {(row["model"], row["configuration"]): row["rank"] for row in board["overall"]}
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for task in board["tasks"]:
        for row in task["rows"]:
            rows.setdefault((row["model"], row["configuration"]), {})[task["task"]] = row
    ordered = sorted(rows, key=lambda key: (ranks.get(key) is None, ranks.get(key), key[0]))
    names = [_marked(list(rows[key].values())) for key in ordered]
    tasks = [task["task"] for task in board["tasks"]]
    _print_matrix(
        tasks,
        [
            _Row(_rank(ranks.get(key)), harmless(name), rows[key])
            for key, name in zip(ordered, names, strict=True)
        ],
    )
    say()
    for text in _legend(board):
        say(text)


def task_table(task: Mapping[str, Any]) -> None:
    """Prints all models on one task."""
    _print_rows(
        tuple(ROW),
        task["rows"],
        title=emphasised(f"{task['task']}: {in_words(task['indicator'], task['unit'])}"),
        notes=[
            "* baseline; # is shared by statistically tied models",
            "95 % is the exact interval of the success rate, and the one of the mean indicator",
            "too few: with so few successes no interval of the mean indicator holds",
            *_remarks(task["rows"]),
            *_of_runners(task["rows"]),
        ],
    )


def _print_rows(
    names: Sequence[str],
    rows: Sequence[Mapping[str, Any]],
    *,
    title: str,
    notes: Sequence[str] = (),
) -> None:
    numeric = [name for name in names if name != "model"]
    cells = [[ROW[name](row) for name in names] for row in rows]
    shown = columns(*names, numeric=numeric, leaving=LEAVING)
    print_table(shown, cells, title=title, notes=notes)


def overall_table(board: Mapping[str, Any]) -> None:
    """Prints the ranking over all tasks that it is over."""
    rows, ranked = [], board.get("ranked") or []
    whole = len(ranked) in (0, len(board["tasks"]))
    scope = "All tasks together" if whole else f"Over {', '.join(ranked)}"
    for row in board["overall"]:
        rate, placed = row["success_rate_mean"], row["rank"] is not None
        rows.append(
            (
                _rank(row["rank"]),
                row["model"] + ("*" if row["baseline"] else ""),
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
    """Whether figures are at least what they say."""
    return bool(row.get("censored"))


def _rank(rank: int | None) -> str:
    return NOTHING if rank is None else str(rank)


def _interval(low: float | None, high: float | None) -> str:
    return NOTHING if low is None or high is None else f"{100 * low:.0f}-{100 * high:.0f} %"


def _print_matrix(tasks: Sequence[str], rows: Sequence[_Row]) -> None:
    """Prints models x tasks in the way that takes the fewest blocks."""
    room = terminal_width() if is_terminal() else None
    for intervals in (True, False):
        ways = [_by_model(tasks, rows, intervals=intervals)]
        if room is not None:
            ways.append(_by_task(tasks, rows, intervals=intervals))
        fitting = [way for way in ways if room is None or _narrowest(way) <= room]
        if fitting:
            break
    fewest = min((_groups(way, room) for way in fitting or ways), key=len)
    for place, group in enumerate(fewest):
        lines = [GAP.join(parts).rstrip() for parts in zip(*group, strict=True)]
        print_lines([*([""] if place else []), emphasised(lines[0]), *lines[1:]])


def _by_model(tasks: Sequence[str], rows: Sequence[_Row], *, intervals: bool) -> list[list[str]]:
    """A row for each model: the column of names, and one of each task."""
    names = _aligned([("#", "model"), *((row.rank, row.name) for row in rows)], right=(0,))
    columns_ = [_cells([row.by_task.get(task) for row in rows], intervals) for task in tasks]
    return [names, *(_column([task], cells) for task, cells in zip(tasks, columns_, strict=True))]


def _by_task(tasks: Sequence[str], rows: Sequence[_Row], *, intervals: bool) -> list[list[str]]:
    """A row for each task: the column of tasks, and one of each model below its rank."""
    names = _aligned([(text,) for text in ("model", "#", *tasks)], right=())
    columns_ = [_cells([row.by_task.get(task) for task in tasks], intervals) for row in rows]
    return [
        names,
        *(_column([row.name, row.rank], cells) for row, cells in zip(rows, columns_, strict=True)),
    ]


def _groups(way: Sequence[list[str]], room: int | None) -> list[list[list[str]]]:
    """The names with as many columns beside them as there is room for, and so on."""
    names, *others = way
    groups = [[names]]
    for column in others:
        if len(groups[-1]) > 1 and room is not None and _width([*groups[-1], column]) > room:
            groups.append([names])
        groups[-1].append(column)
    return groups


def _narrowest(way: Sequence[list[str]]) -> int:
    return max(_width([way[0], column]) for column in way[1:])


def _width(shown: Sequence[list[str]]) -> int:
    return sum(width_of(column[0]) for column in shown) + len(GAP) * (len(shown) - 1)


def _column(headings: Sequence[str], cells: Sequence[str]) -> list[str]:
    width = max(map(width_of, [*headings, *cells]))
    return [padded(text, width, right=True) for text in (*headings, *cells)]


def _cells(rows: Sequence[Mapping[str, Any] | None], intervals: bool) -> list[str]:
    """Success, interval and indicator of rows, aligned among themselves."""
    names = [name for name in RESULTS if intervals or name != "95 %"]
    cells = [[NOTHING if row is None else ROW[name](row) for name in names] for row in rows]
    return _aligned(cells, right=range(len(names)))


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
    rows = [row for task in board["tasks"] for row in task["rows"]]
    return [
        "Successes of jobs, the rate's exact 95 % interval, and the mean indicator:",
        *(f"  {', '.join(tasks)}: {name}" for name, tasks in indicators.items()),
        "* baseline; # is the overall rank, shared by statistically tied models",
        *_remarks(rows),
        *_meanings(board, rows),
        *_of_runners(rows),
    ]


def _marked(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row's model with its marks, and the limits of its sessions, if they had any.

    Args:
        rows: One model configuration, on one task or several.
    """
    first = rows[0]
    limits = first.get("decoding", {}).get("limits", {})
    spelled = ", ".join(f"{name} {value}" for name, value in limits.items())
    marks = "*" if first.get("baseline") else ""
    marks += "†" if any(row.get("by_runner") for row in rows) else ""
    return f"{first['model']}{marks}" + (f" ({spelled})" if spelled else "")


def _remarks(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is shown of flags, where there are some."""
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
    """What the board's flags say."""
    counts = _flags(rows)
    return [
        f"  {flag['name']}: {flag['meaning']}" for flag in board["flags"] if counts[flag["name"]]
    ]


def _of_runners(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the marks of results mean that others brought, if there are any."""
    by_runner, unverified, refuted = (
        sum(row[name] for row in rows) for name in ("by_runner", "unverified", "refuted")
    )
    remarks = []
    if by_runner:
        remarks.append(f"† with trials by a runner: {by_runner} jobs")
    if unverified:
        remarks.append(
            f"{unverified - refuted} wait for their verification, {refuted} were refuted: "
            "they count nowhere"
        )
    return remarks
