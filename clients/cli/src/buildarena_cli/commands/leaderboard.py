"""The commands leaderboard and compare."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from buildarena_cli.options import (
    JsonOption,
    ModelName,
    ModelsOption,
    ServiceOption,
    TasksOption,
    TrackOption,
    printed_by,
)
from buildarena_cli.terminal.boards import overall_table, overview, task_table
from buildarena_cli.terminal.output import print_json, print_line, print_rows

COMPARED = {
    "task": lambda row: row["task"],
    "first": lambda row: f"{row['successes'][0]:g}/{row['counted_jobs'][0]}",
    "second": lambda row: f"{row['successes'][1]:g}/{row['counted_jobs'][1]}",
    "diff %": lambda row: f"{100 * row['difference']:+.0f}",
    "95 %": lambda row: f"{100 * row['ci_low']:+.0f}..{100 * row['ci_high']:+.0f}",
    "better": lambda row: row["better"] or "-",
}


def leaderboard(
    *,
    task: TasksOption = None,
    category: Annotated[
        list[str] | None,
        typer.Option(help="Only tasks of these categories, such as flight, ranked separately."),
    ] = None,
    model: ModelsOption = None,
    track: Annotated[
        str | None, typer.Option(help="Only this track; by default all, with --json one.")
    ] = None,
    client: ServiceOption,
    as_json: JsonOption = False,
) -> None:
    """Show the ranking of models on each track.

    One overview of models and tasks comes first; --task shows a task's details.
    """
    asked: dict[str, Any] = {"task": task, "category": category, "model": model}
    board = client.leaderboard(track=track, **asked)
    if as_json:
        print_json(board)
        return
    tracks = [] if track else [name for name in board["tracks"] if name != board["track"]]
    boards = [board, *(client.leaderboard(track=name, **asked) for name in tracks)]
    filled = [board for board in boards if board["tasks"]]
    if not filled:
        print_line("No matching job has ended yet.")
    for place, board in enumerate(filled):
        print_line(("\n" if place else "") + f"Track {board['track']}")
        if board["verdict"] is not None and board["overall"]:
            print_line(board["verdict"]["sentence"])
        if task:
            for found in board["tasks"]:
                task_table(board, found)
        else:
            overview(board)
        if len(board["tasks"]) > 1 and board["overall"]:
            overall_table(board)


def _show_comparison(answer: dict[str, Any]) -> None:
    print_line(f"Track {answer['track']}")
    print_line(answer["sentence"] or "They share no task on this track.")
    print_rows(
        COMPARED,
        answer["tasks"],
        notes=[
            "diff %: difference of success rates with its 95 % interval",
            "better: beyond chance, by success and indicator together",
        ],
    )


@printed_by(_show_comparison)
def compare(
    first: ModelName,
    second: ModelName,
    *,
    task: TasksOption = None,
    track: TrackOption = None,
    client: ServiceOption,
) -> Any:
    """Show whether one model is better than another.

    Each is a model, or model@configuration. The tests are those of a board of the two alone.
    """
    return client.compare(first, second, task=task, track=track)
