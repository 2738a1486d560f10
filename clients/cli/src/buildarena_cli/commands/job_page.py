"""`buildarena job page`: a job's machine and trial as one file that anybody can open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from buildarena_cli.client import Client
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import whole_id
from buildarena_cli.machines import shown_errors
from buildarena_cli.options import DEFAULT_URL, JobId, UrlOption
from buildarena_cli.terminal.output import say


def page(
    job_id: JobId,
    *,
    out: Annotated[
        Path | None, typer.Option(help="The file to write; by default the job's id and .html.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write a job's machine and trial as one HTML file, which needs no server and no network."""
    try:
        from buildarena.service import job_page
    except ImportError as error:
        raise CommandError("pages are made by the whole: pip install buildarena") from error
    whole = whole_id(Client(url), "job", job_id)
    target = out or Path(f"{whole}.html")
    with shown_errors():
        text = job_page(whole, url)
    try:
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CommandError(f"{target} can't be written: {error.strerror}") from error
    say(str(target))
