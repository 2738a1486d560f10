"""`buildarena worker start` and `migrate`: parts of a service that runs on several machines."""

from __future__ import annotations

from typing import Annotated

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.instead import run_instead
from buildarena_cli.lazy import new_group
from buildarena_cli.near import did_you_mean
from buildarena_cli.terminal.output import say

app = new_group("Run workers by themselves.")


@app.command("start")
def start_worker(
    queue: Annotated[
        str, typer.Argument(help="construct, or simulate.SIMULATOR, such as simulate.mujoco.")
    ],
) -> None:
    """Serve a queue from this process, with the servers that BUILDARENA_* name, until Ctrl-C."""
    from buildarena_cli.local.programs import programs
    from buildarena_pipeline.catalog.simulators import SIMULATORS

    known = programs(SIMULATORS)
    workers = {program.queue: program.words for program in known if program.queue}
    if queue not in workers:
        raise CommandError(
            f"there is no queue {queue!r}; choose from {', '.join(workers)}"
            f"{did_you_mean(queue, workers)}"
        )
    run_instead(workers[queue])


def migrate() -> None:
    """Bring the database to this program's schema.

    The database is the one that BUILDARENA_DATABASE_URL names.
    """
    from buildarena_pipeline.errors import StartupError
    from buildarena_pipeline.runtime.settings import load_settings
    from buildarena_store import Database

    try:
        url = load_settings().required_database_url()
    except (StartupError, ValueError) as error:
        raise CommandError(str(error)) from error
    database = Database(url)
    say(f"schema {database.migrate()}")
    database.close()
