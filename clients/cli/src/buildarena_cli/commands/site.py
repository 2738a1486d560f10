"""The command ``buildarena site``: a board to publish."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from buildarena_cli.errors import USAGE, CommandError
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import ServiceOption
from buildarena_cli.terminal.output import print_line

MB: Final = 1_000_000


def site(
    sweeps: Annotated[
        list[str] | None,
        typer.Argument(help="Ids of sweeps, or their beginnings.", metavar="[SWEEP]..."),
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
    client: ServiceOption,
) -> None:
    """Write a board as a static site, which any file server can show.

    It contains the dashboard's pages and data: leaderboard, tasks, models, sweeps and jobs, and
    works under any path. Another run continues an interrupted one, and adds new jobs.
    """
    if not sweeps and track is None:
        raise CommandError("name the sweeps to publish, or a track: --track", code=USAGE)
    from buildarena_cli.site.folder import Folder
    from buildarena_cli.site.scope import choose_jobs, read_choice, read_scope
    from buildarena_cli.site.writing import built_pages, write_site

    per_cell, folder, pages = read_choice(jobs), Folder(out), built_pages()
    scope = read_scope(client, [resolve_id(client, "sweep", id_) for id_ in sweeps or ()], track)
    written = write_site(client, scope, choose_jobs(scope, per_cell), folder, pages)
    print_line(written.holds)
    for sentence in written.left_out:
        print_line(sentence)
    print_line(
        f"{out}: {written.size / MB:,.1f} MB; any file server shows it, such as "
        "`python -m http.server`"
    )
