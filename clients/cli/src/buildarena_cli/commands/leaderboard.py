"""The commands around the leaderboard: leaderboard, compare, export, audit."""

from __future__ import annotations

import time
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from buildarena_cli.client import Client
from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, leaderboard_tables, number, print_json

FORMATS = {".csv": "csv", ".parquet": "parquet", ".tex": "latex"}

TrackOption = Annotated[str | None, typer.Option(help="Track; default: the first.")]
TaskOption = Annotated[list[str] | None, typer.Option("--task", help="Only these tasks.")]
LevelOption = Annotated[list[int] | None, typer.Option("--level", help="Only these levels.")]
ModelOption = Annotated[list[str] | None, typer.Option("--model", help="Only these models.")]
SinceOption = Annotated[
    datetime | None, typer.Option(help="Only jobs that ended then or later (UTC).")
]
FlaggedOption = Annotated[bool, typer.Option("--flagged", help="Count flagged successes too.")]


def leaderboard(
    *,
    task: TaskOption = None,
    level: LevelOption = None,
    model: ModelOption = None,
    since: SinceOption = None,
    flagged: FlaggedOption = False,
    track: TrackOption = None,
    published: Annotated[bool, typer.Option(help="Also show the paper's figures.")] = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show who builds best on one track."""
    with closing(Client(url)) as client:
        board = client.get(
            "/v1/leaderboard",
            task=task,
            level=level,
            model=model,
            since=None if since is None else f"{since.isoformat()}Z",
            flagged=flagged or None,
            track=track,
        )
    if as_json:
        print_json(board)
        return
    if not board["tasks"]:
        console.print("No jobs have ended yet.")
        return
    console.print(f"Track {board['track']}", soft_wrap=True)
    for number_, table in enumerate(leaderboard_tables(board)):
        console.print(table)
        if published:
            console.print(_published_table(board["tasks"][number_]))
    if len(board["tasks"]) > 1 and board["overall"]:
        console.print(_overall_table(board))


def compare(
    first: Annotated[str, typer.Argument(help="A model, or model@configuration.")],
    second: Annotated[str, typer.Argument(help="Another.")],
    *,
    task: TaskOption = None,
    track: TrackOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Tell whether one model is better than another; tests only where they share seeds."""
    with closing(Client(url)) as client:
        answer = client.get(
            "/v1/leaderboard/compare", first=first, second=second, task=task, track=track
        )
    if as_json:
        print_json(answer)
        return
    table = Table(
        title=f"{first} against {second}",
        caption="difference of success rates with its 95 % interval; p of McNemar's and "
        "Wilcoxon's tests on shared seeds, adjusted over the tasks (Holm)",
        title_justify="left",
        caption_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("task", no_wrap=True)
    for name in ("first", "second", "diff %", "95 %", "pairs", "p success", "p indicator"):
        table.add_column(name, justify="right")
    for row in answer["tasks"]:
        (won_1, won_2), (of_1, of_2) = row["successes"], row["trials"]
        table.add_row(
            row["task"],
            f"{won_1}/{of_1}",
            f"{won_2}/{of_2}",
            f"{100 * row['difference']:+.0f}",
            f"{100 * row['low']:+.0f}..{100 * row['high']:+.0f}",
            str(row["success"]["pairs"]) if row["success"] else "0",
            number(row["success_p"], 4),
            number(row["indicator_p"], 4),
        )
    console.print(table)


def export(
    out: Annotated[Path, typer.Option("--out", help="File: .csv, .parquet or .tex.")],
    *,
    task: TaskOption = None,
    level: LevelOption = None,
    model: ModelOption = None,
    flagged: FlaggedOption = False,
    track: TrackOption = None,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write the leaderboard to a file, the paper's figures marked beside ours."""
    kind = FORMATS.get(out.suffix)
    if kind is None:
        raise CommandError(f"{out}: the name must end in {', '.join(FORMATS)}")
    with closing(Client(url)) as client:
        body = client.get_bytes(
            "/v1/leaderboard/export",
            format=kind,
            task=task,
            level=level,
            model=model,
            flagged=flagged or None,
            track=track,
        )
    write_file(out, body)
    console.print(f"{out}: {len(body):,} bytes", soft_wrap=True)


def audit(
    model: Annotated[str, typer.Argument(help="The model whose results are checked.")],
    *,
    sample: Annotated[int | None, typer.Option(help="How many results; default: all.")] = None,
    seed: Annotated[int, typer.Option(help="Of the choice of the sample.")] = 0,
    task: TaskOption = None,
    track: TrackOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Replay and simulate a model's results again, and tell every difference."""
    body = {"model": model, "sample": sample, "seed": seed, "tasks": task, "track": track}
    differences: list[dict[str, Any]] = []
    with closing(Client(url)) as client:
        accepted = client.post("/v1/leaderboard/verify", body)
        for id_ in accepted["verifications"]:
            check = client.get_patiently(f"/v1/verifications/{id_}")
            while check["state"] != "done":
                time.sleep(0.3)
                check = client.get_patiently(f"/v1/verifications/{id_}")
            if not check["report"]["ok"]:
                wrong = [entry for entry in check["report"]["checks"] if not entry["ok"]]
                differences.append({"job_id": check["job_id"], "checks": wrong})
    checked = len(accepted["verifications"])
    if as_json:
        print_json({"scored": accepted["scored"], "checked": checked, "differences": differences})
    else:
        console.print(f"{checked} of {accepted['scored']} results checked")
        for found in differences:
            for entry in found["checks"]:
                console.print(
                    f"!!  {found['job_id']} {entry['name']}: kept {entry['kept']}, "
                    f"found {entry['found']}",
                    soft_wrap=True,
                )
        if not differences:
            console.print("Every figure is the same.")
    raise typer.Exit(FAILED if differences else DONE)


def write_file(path: Path, body: bytes) -> None:
    """Writes a file, or says in one sentence why not.

    Raises:
        CommandError: It can't be written.
    """
    try:
        path.write_bytes(body)
    except OSError as error:
        raise CommandError(f"{path} can't be written: {error.strerror}") from error


def _overall_table(board: dict[str, Any]) -> Table:
    table = Table(
        title="All tasks together",
        caption="# shared by models that can't be told apart; place: 95 % interval; "
        "+ nothing else is both better and cheaper; custom tasks count when asked for",
        title_justify="left",
        caption_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("#", justify="right")
    table.add_column("model", no_wrap=True)
    for name in ("place", "mean rank", "success", "USD", ""):
        table.add_column(name, justify="right")
    for row in board["overall"]:
        rate = row["success_rate_mean"]
        ranked = row["rank"] is not None
        table.add_row(
            str(row["rank"]) if ranked else "-",
            row["model"] + ("*" if row["baseline"] else ""),
            f"{row['rank_low']}-{row['rank_high']}" if ranked else "-",
            number(row["mean_rank"], 2),
            "-" if rate is None else f"{100 * rate:.1f} %",
            number(row["cost_usd_mean"], 2),
            "+" if row["pareto"] else "",
        )
    return table


def _published_table(task: dict[str, Any]) -> Table:
    table = Table(
        title=f"{task['task']}, as published: measured in the game, never ranked with ours",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        style="dim",
    )
    table.add_column("model", no_wrap=True)
    for name in ("success", "95 %", task["indicator"], "parts", "requests", "tokens"):
        table.add_column(name, justify="right")
    for row in task["published"]:
        table.add_row(
            row["model"],
            f"{row['successes']}/{row['trials']}",
            f"{100 * row['success_low']:.0f}-{100 * row['success_high']:.0f} %",
            number(row["indicator_mean"]),
            number(row["parts_mean"]),
            number(row["requests_mean"], 0),
            number(row["output_tokens_mean"], 0),
        )
    return table
