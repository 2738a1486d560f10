"""`buildarena worker`, `migrate` and `roles`: parts of a service that runs on several machines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from buildarena_cli.defaults import KEY_VARIABLE
from buildarena_cli.errors import USAGE, CommandError
from buildarena_cli.exec import exec_module
from buildarena_cli.given_paths import to_read
from buildarena_cli.lazy import new_group
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.suggestions import did_you_mean
from buildarena_cli.terminal.output import columns, minute_of, number, print_json, print_table, say

if TYPE_CHECKING:
    from buildarena_store import Database

app = new_group("Run workers by themselves.")

SIMULATE: Final = "simulate."
MEBIBYTE: Final = 1024 * 1024
MAX_LISTED: Final = 500
COLUMNS = columns(
    *("worker", "queues", "state", "version", "MiB", "since"),
    numeric=("MiB",),
    leaving=("since", "MiB", "version"),
)
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
        "--ca-file", help="Certificates to trust besides the system's (PEM).", callback=to_read
    ),
]
AllowHttpOption = Annotated[
    bool, typer.Option("--allow-http", help="Send the key unencrypted to another machine.")
]


@app.command("start")
def start_worker(
    queue: Annotated[
        str, typer.Argument(help="construct, or simulate.SIMULATOR, such as simulate.mujoco.")
    ],
    *,
    api: ApiOption = None,
    key_file: KeyFileOption = None,
    ca_file: CaFileOption = None,
    at_once: Annotated[
        int | None, typer.Option("--at-once", help="Trials at once, with --api.", min=1, max=64)
    ] = None,
    allow_http: AllowHttpOption = False,
) -> None:
    """Serve a queue from this process until Ctrl-C.

    It uses the servers that BUILDARENA_* name; with --api it is a runner, which needs neither
    database nor broker.
    """
    options = _options({"--key-file": key_file, "--ca-file": ca_file, "--at-once": at_once})
    options += ["--allow-http"] * allow_http
    if api is not None:
        exec_module([*_remote(queue), "--api", api, *options])
    if options:
        raise CommandError(f"{options[0]}: only with --api URL")
    exec_module(_known(queue))


@app.command("list")
def list_workers(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the workers that a service heard of within the last hour, runners included."""
    from buildarena_cli.client import Client

    pages = Client(url).pages("/v1/workers", limit=MAX_LISTED)
    workers = [worker for page in pages for worker in page["workers"]]
    if as_json:
        print_json(workers)
        return
    print_table(COLUMNS, [_row(worker) for worker in workers])


@app.command("doctor")
def check_runner(
    queue: Annotated[str, typer.Argument(help="The queue to serve, such as simulate.mujoco.")],
    *,
    api: Annotated[str, typer.Option("--api", metavar="URL", help="The API to reach.")],
    key_file: KeyFileOption = None,
    ca_file: CaFileOption = None,
    allow_http: AllowHttpOption = False,
    as_json: JsonOption = False,
) -> None:
    """Show whether a runner could work from here, and what to do if not.

    The exit code is 1 when anything is wrong.
    """
    words = [*_remote(queue), "--api", api, "--check"]
    words += _options({"--key-file": key_file, "--ca-file": ca_file})
    exec_module([*words, *(["--allow-http"] * allow_http), *(["--json"] * as_json)])


def migrate() -> None:
    """Bring the database to this program's schema.

    The database is the one that BUILDARENA_DATABASE_URL names. Roles that `buildarena roles` made
    get their rights on it.
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
    from buildarena_store.roles import RoleError, make_roles

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
    """The database that the settings name."""
    from buildarena_pipeline.errors import StartupError
    from buildarena_pipeline.runtime.settings import load_settings
    from buildarena_store import Database

    try:
        url = load_settings().direct_database_url()
    except (StartupError, ValueError) as error:
        raise CommandError(str(error)) from error
    database = Database(url, name="buildarena-command")
    try:
        yield database
    finally:
        database.close()


def _known(queue: str) -> list[str]:
    """The words of the program that serves a queue."""
    from buildarena_cli.local.programs import programs
    from buildarena_pipeline.errors import StartupError
    from buildarena_pipeline.runtime.simulators.installed import installed_simulators

    try:
        known = programs(installed_simulators())
    except StartupError as error:
        raise CommandError(str(error)) from error
    workers = {program.queue: program.words for program in known if program.queue}
    if queue not in workers:
        raise CommandError(
            f"there is no queue {queue!r}; choose from {', '.join(workers)}"
            f"{did_you_mean(queue, workers)}"
        )
    return list(workers[queue])


def _remote(queue: str) -> list[str]:
    """The words of the program that serves a queue through the API."""
    words = _known(queue)
    if not queue.startswith(SIMULATE):
        raise CommandError(f"{queue!r} needs the database: with --api, {SIMULATE}SIMULATOR")
    return words


def _options(flags: Mapping[str, object]) -> list[str]:
    """Options that are given, as words."""
    return [word for name, value in flags.items() if value for word in (name, str(value))]


def _row(worker: dict[str, Any]) -> list[str]:
    versions, peak = worker["versions"], worker["peak_memory_bytes"]
    shown = [str(versions[name]) for name in ("engine", "simulation") if name in versions]
    return [
        worker["id"],
        ", ".join(worker["queues"]),
        "alive" if worker["alive"] else f"last seen {minute_of(worker['seen_at'])}",
        " ".join(shown),
        "" if peak is None else number(peak / MEBIBYTE, 0),
        minute_of(worker["started_at"]),
    ]
