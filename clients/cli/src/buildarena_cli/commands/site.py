"""The command ``buildarena site``: a board to publish."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from buildarena_cli.client import Client
from buildarena_cli.errors import USAGE, CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.options import DEFAULT_URL, UrlOption
from buildarena_cli.terminal.completion import complete_sweep
from buildarena_cli.terminal.output import is_terminal, say

if TYPE_CHECKING:
    from buildarena_cli.site.writing import Plan

LARGE_MB: Final = 200
"""A larger site is written only when it is said to be wanted."""
MB: Final = 1_000_000


def site(
    sweeps: Annotated[
        list[str] | None,
        typer.Argument(
            help="Ids of sweeps, or their beginnings.",
            metavar="[SWEEP]...",
            autocompletion=complete_sweep,
        ),
    ] = None,
    *,
    out: Annotated[Path, typer.Option("--out", help="Folder of the site.")],
    track: Annotated[
        str | None, typer.Option("--track", help="Only this track; without sweeps, all of it.")
    ] = None,
    jobs: Annotated[
        str,
        typer.Option(
            "--jobs",
            help="Jobs with transcript, replay and trials: all, best (of task and model), none, "
            "or a number of each task and model.",
        ),
    ] = "all",
    yes: Annotated[bool, typer.Option("--yes", help="Write it however large it is.")] = False,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write a board as a static site, which any file server can show.

    The dashboard's pages with their answers as files: leaderboard, tasks, models, sweeps and jobs.
    It may lie under any path. Run again, it goes on where it stopped, and takes what is new.
    """
    if not sweeps and track is None:
        raise CommandError("name the sweeps to publish, or a track: --track", code=USAGE)
    from buildarena_cli.site.folder import Folder
    from buildarena_cli.site.pages import built_pages
    from buildarena_cli.site.scope import chosen_jobs, read_choice, read_scope
    from buildarena_cli.site.writing import plan_site, write_site

    per_cell, folder, pages = read_choice(jobs), Folder(out), built_pages()
    client = Client(url)
    scope = read_scope(client, [whole_id(client, "sweep", id_) for id_ in sweeps or ()], track)
    plan = plan_site(client, scope, chosen_jobs(scope, per_cell), folder, pages)
    say(f"{out} will take about {_size(plan.size)}. {plan.holds}")
    for sentence in plan.left_out:
        say(sentence)
    if not (yes or plan.size <= LARGE_MB * MB or _wanted(plan)):
        say("Nothing was written.")
        return
    written = write_site(client, plan, folder)
    say(f"{out}: {_size(written)}; any file server shows it, such as `python -m http.server`")


def _size(size: int) -> str:
    return f"{size / MB:,.1f} MB"


def _wanted(plan: Plan) -> bool:
    """Whether a person wants a large site.

    Raises:
        CommandError: Nobody can be asked.
    """
    if not (is_terminal() and sys.stdin.isatty()):
        raise CommandError(
            f"{_size(plan.size)} is more than {LARGE_MB} MB: --yes writes it all the same, "
            "and `--jobs best` makes it smaller",
            code=USAGE,
        )
    return typer.confirm("Write it?")
