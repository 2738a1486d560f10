"""The commands leaderboard and compare."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from buildarena_cli.client import Client
from buildarena_cli.options import (
    DEFAULT_URL,
    JsonOption,
    ModelName,
    ModelsOption,
    TasksOption,
    TrackOption,
    UrlOption,
)
from buildarena_cli.terminal.boards import overall_table, overview, task_table
from buildarena_cli.terminal.output import print_json, print_table, say

COMPARED = ("first", "second", "diff %", "95 %")

CategoryOption = Annotated[
    list[str] | None,
    typer.Option(
        "--category", help="Only tasks of these categories, such as flight, ranked separately."
    ),
]


def leaderboard(
    *,
    task: TasksOption = None,
    category: CategoryOption = None,
    model: ModelsOption = None,
    track: Annotated[
        str | None,
        typer.Option("--track", help="Only this track; by default all, with --json one."),
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show the ranking of models on each track.

    One overview of models and tasks comes first; --task shows a task's details.
    """
    asked: dict[str, Any] = {
        "task": task,
        "category": category,
        "model": model,
    }
    client = Client(url)
    board = client.get("/v1/leaderboard", track=track, **asked)
    if as_json:
        print_json(board)
        return
    tracks = [] if track else [name for name in board["tracks"] if name != board["track"]]
    boards = [board, *(client.get("/v1/leaderboard", track=name, **asked) for name in tracks)]
    filled = [board for board in boards if board["tasks"]]
    if not filled:
        say("No matching job has ended yet.")
    for place, board in enumerate(filled):
        if place:
            say()
        _show(board, details=bool(task))


def _show(board: dict[str, Any], *, details: bool) -> None:
    say(f"Track {board['track']}")
    if board["verdict"] is not None and board["overall"]:
        say(board["verdict"]["sentence"])
    if not details:
        say()
        overview(board)
    else:
        for task in board["tasks"]:
            say()
            task_table(task)
    if len(board["tasks"]) > 1 and board["overall"]:
        say()
        overall_table(board)


def compare(
    first: ModelName,
    second: ModelName,
    *,
    task: TasksOption = None,
    track: TrackOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show whether one model is better than another.

    Each is a model, or model@configuration. The tests are those of a board of the two alone.
    """
    client = Client(url)
    answer = client.get(
        "/v1/leaderboard/compare",
        first=first,
        second=second,
        task=task,
        track=track,
    )
    if as_json:
        print_json(answer)
        return
    say(f"Track {answer['track']}")
    say(answer["sentence"] or "They share no task on this track.")
    rows = []
    for row in answer["tasks"]:
        (won_1, won_2), (of_1, of_2) = row["successes"], row["counted_jobs"]
        rows.append(
            (
                row["task"],
                f"{won_1:g}/{of_1}",
                f"{won_2:g}/{of_2}",
                f"{100 * row['difference']:+.0f}",
                f"{100 * row['ci_low']:+.0f}..{100 * row['ci_high']:+.0f}",
                {"first": first, "second": second}.get(row["better"], "-"),
            )
        )
    print_table(
        ("task", *COMPARED, "better"),
        rows,
        numeric=COMPARED,
        title=f"{first} against {second}",
        notes=[
            "diff %: difference of success rates with its 95 % interval",
            "better: beyond chance, by success and indicator together",
        ],
    )
