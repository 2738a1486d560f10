"""What commands print: JSON for programs, tables that fit the terminal for people."""

from __future__ import annotations

import json
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

console = Console(highlight=False)
error_console = Console(stderr=True, highlight=False)


def print_json(value: Any) -> None:
    """One JSON document on standard output."""
    console.file.write(json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def number(value: float | None, digits: int = 1) -> str:
    """A number for people; a dash for nothing."""
    return "-" if value is None else f"{value:,.{digits}f}"


def in_words(indicator: str, unit: str) -> str:
    """An indicator with its unit, if it has one."""
    name = indicator.replace("_", " ")
    return name if unit in {"", "1"} else f"{name} in {unit}"


def leaderboard_tables(board: dict[str, Any]) -> list[Table]:
    """One table for each task of a leaderboard answer; each fits 80 columns."""
    tables = []
    for task in board["tasks"]:
        table = Table(
            title=f"{task['task']}: {in_words(task['indicator'], task['unit'])}",
            title_justify="left",
            caption="* baseline; # is shared by models that can't be told apart; "
            "95 % is the Wilson interval of the success rate",
            caption_justify="left",
            box=SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        table.add_column("#", justify="right")
        table.add_column("model", no_wrap=True)
        for name in ("success", "95 %", "indicator", "parts", "requests", "tokens", "USD"):
            table.add_column(name, justify="right")
        for row in task["rows"]:
            interval = "-"
            if row["success_low"] is not None:
                interval = f"{100 * row['success_low']:.0f}-{100 * row['success_high']:.0f} %"
            table.add_row(
                "-" if row["rank"] is None else str(row["rank"]),
                row["model"] + ("*" if row["baseline"] else ""),
                f"{row['successes']}/{row['trials']}",
                interval,
                number(row["indicator_mean"]),
                number(row["parts_mean"]),
                number(row["requests_mean"], 0),
                number(row["output_tokens_mean"], 0),
                number(row["cost_usd_mean"], 2),
            )
        tables.append(table)
    return tables
