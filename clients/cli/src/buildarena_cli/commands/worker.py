"""`buildarena admin worker`, `migrate` and `roles`: a service that runs on several machines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from buildarena_cli.defaults import KEY_VARIABLE
from buildarena_cli.errors import USAGE, CommandError, did_you_mean
from buildarena_cli.exec import exec_module
from buildarena_cli.options import JsonOption, to_read
from buildarena_cli.terminal.output import say

if TYPE_CHECKING:
    from buildarena_backend.database.database import Database

SIMULATE: Final = "simulate."
ApiOption = Annotated[
    str | None,
    typer.Option("--api", metavar="URL", help="Reach only this API, with a runner key."),
]
KeyFileOption = Annotated[
    Path | None,
    typer.Option(
        "--key-file", help=f"File with the runner key; default: {KEY_VARIABLE}.", callback=to_read
    ),
]
CaFileOption = Annotated[
    Path | None,
    typer.Option(
        "--ca-file", help="Certificates (PEM) to trust besides the system's.", callback=to_read
    ),
]
AllowHttpOption = Annotated[
    bool, typer.Option("--allow-http", help="Send the key unencrypted to another machine.")
]


def worker(
    queue: Annotated[
        str, typer.Argument(help="construct, or simulate.SIMULATOR, such as simulate.mujoco.")
    ],
    *,
    api: ApiOption = None,
    key_file: KeyFileOption = None,
    ca_file: CaFileOption = None,
    at_once: Annotated[
        int | None,
        typer.Option(
            "--concurrency", help="Trials to run concurrently (runners only).", min=1, max=64
        ),
    ] = None,
    allow_http: AllowHttpOption = False,
    check: Annotated[
        bool,
        typer.Option("--check", help="Only check whether a runner could work on this machine."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Serve a queue from this process until Ctrl-C.

    It uses the servers that BUILDARENA_* name; with --api it is a runner, which needs neither
    database nor broker.
    """
    options = _options({"--key-file": key_file, "--ca-file": ca_file, "--concurrency": at_once})
    options += [
        *(["--allow-http"] * allow_http),
        *(["--check"] * check),
        *(["--json"] * (check and as_json)),
    ]
    if api is not None:
        exec_module([*_remote(queue), "--api", api, *options])
    if options:
        raise CommandError(f"{options[0]}: only with --api URL")
    exec_module(_program_for(queue))


def migrate() -> None:
    """Bring the database to this program's schema.

    The database is the one that BUILDARENA_DATABASE_URL names. Roles that `admin roles` made get
    their rights on it.
    """
    with _database() as database:
        say(f"schema {database.migrate()}")


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
    from buildarena_backend.database.roles import RoleError, make_roles

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
        try:
            make_roles(database, urls)
        except RoleError as error:
            raise CommandError(str(error)) from error
    say(f"logins for {', '.join(urls)}")


@contextmanager
def _database() -> Iterator[Database]:
    """Yield the database that the settings name."""
    from buildarena_backend.database.database import Database
    from buildarena_backend.errors import SchemaVersionError, StartupError
    from buildarena_backend.settings import load_settings

    try:
        url = load_settings().direct_database_url()
    except (StartupError, ValueError) as error:
        raise CommandError(str(error)) from error
    database = Database(url, name="buildarena-command")
    try:
        yield database
    except SchemaVersionError as error:
        raise CommandError(str(error)) from error
    finally:
        database.close()


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


def _remote(queue: str) -> list[str]:
    """Return the arguments of the program for a queue, served through the API."""
    arguments = _program_for(queue)
    if not queue.startswith(SIMULATE):
        raise CommandError(f"{queue!r} needs the database: with --api, {SIMULATE}SIMULATOR")
    return arguments


def _options(flags: Mapping[str, object]) -> list[str]:
    """Return the options that were set, as arguments."""
    return [word for name, value in flags.items() if value for word in (name, str(value))]
