"""`buildarena admin worker`, `migrate` and `roles`: a service that runs on several machines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from buildarena_cli.errors import USAGE, CommandError, did_you_mean
from buildarena_cli.exec import exec_module
from buildarena_cli.options import settings_with
from buildarena_cli.terminal.output import print_line

if TYPE_CHECKING:
    from buildarena_backend.database.database import Database


def worker(
    context: typer.Context,
    queue: Annotated[
        str, typer.Argument(help="construct, or simulate.SIMULATOR, such as simulate.mujoco.")
    ],
) -> None:
    """Serve a queue from this process until Ctrl-C, with the servers that BUILDARENA_* name.

    With --api URL a simulation worker is a runner, which reaches only this API. Its further
    options: --key-file FILE (default: BUILDARENA_KEY), --ca-file FILE (certificates to trust
    besides the system's), --concurrency N (trials at once), --allow-http (send the key
    unencrypted), --check (only check whether it could work here; with --json).
    """
    program, options = _program_for(queue), context.args
    if options and "--api" not in options:
        raise CommandError(f"{options[0]}: only with --api URL")
    if options and not queue.startswith("simulate."):
        raise CommandError(f"{queue!r} needs the database: with --api, simulate.SIMULATOR")
    exec_module([*program, *options])


def migrate() -> None:
    """Bring the database to this program's schema.

    The database is the one that BUILDARENA_DATABASE_URL names. Roles that `admin roles` made get
    their rights on it.
    """
    with _database() as database:
        print_line(f"schema {database.migrate()}")


def roles(
    logins: Annotated[
        list[str],
        typer.Argument(
            metavar="ROLE=FILE",
            help="A role (owner, api, construct, simulate, reader), and a file with the URL that "
            "its process signs in with.",
        ),
    ],
) -> None:
    """Make the logins of a service's processes.

    Each has only the rights of its role. BUILDARENA_DATABASE_URL names an account that may make
    roles; the owner gets the tables, and then migrates. It is safe to repeat: new passwords count.
    """
    from buildarena_backend.database.roles import make_roles

    urls = {}
    for login in logins:
        role, separator, file = login.partition("=")
        if not separator:
            raise CommandError(f"{login!r} is not ROLE=FILE, such as api=secrets/api_url")
        try:
            urls[role] = Path(file).read_text(encoding="utf-8").strip()
        except OSError as error:
            raise CommandError(f"{file} can't be read: {error.strerror}", USAGE) from error
    with _database() as database:
        make_roles(database, urls)
    print_line(f"logins for {', '.join(urls)}")


@contextmanager
def _database() -> Iterator[Database]:
    """Yield the database that the settings name."""
    from buildarena_backend.database.database import Database
    from buildarena_backend.database.roles import RoleError
    from buildarena_backend.errors import SchemaVersionError

    try:
        database = Database(settings_with().direct_database_url(), name="buildarena-command")
        try:
            yield database
        finally:
            database.close()
    except (SchemaVersionError, RoleError, ValueError) as error:
        raise CommandError(str(error)) from error


def _program_for(queue: str) -> list[str]:
    """Return the arguments of the program for a queue."""
    from buildarena_backend.errors import StartupError
    from buildarena_backend.trials.installed_simulators import installed_simulators
    from buildarena_cli.local.programs import programs

    try:
        available = programs(installed_simulators())
    except StartupError as error:
        raise CommandError(str(error)) from error
    workers = {program.queue: program.arguments for program in available if program.queue}
    if queue not in workers:
        raise CommandError(
            f"unknown queue {queue!r}; valid queues: {', '.join(workers)}"
            f"{did_you_mean(queue, workers)}"
        )
    return list(workers[queue])
