"""Direct access of commands to the database and the artifacts, without the API."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.exc import OperationalError

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.database.database import Database
from buildarena_backend.errors import StartupError, StoreError
from buildarena_cli.errors import CommandError
from buildarena_cli.local.postgres import EmbeddedPostgres, url_of_running
from buildarena_cli.local.service import LOCK, is_running, unwritable
from buildarena_cli.options import settings_with


@dataclass(frozen=True, slots=True, kw_only=True)
class Stores:
    """Database and artifact store of a command.

    Attributes:
        url: Its address.
    """

    database: Database
    url: str
    artifacts: ArtifactStore


@contextmanager
def opened_stores(data: Path | None, *, new: bool = False) -> Iterator[Stores]:
    """Yield the stores that the settings name, or those of a data folder.

    A data folder's Postgres is started for the block unless it runs already.

    Args:
        data: The data folder; by default the settings'.
        new: Whether the stores will be filled, so that nothing may run on the folder.

    Raises:
        CommandError: The folder is missing or in use, or the stores failed inside the block.
    """
    try:
        settings = settings_with(data=data)
        with ExitStack() as stack:
            url = settings.database_direct_url or settings.database_url
            url = url or _embedded(settings.data.absolute(), stack, new=new)
            database = Database(url, name="buildarena-command")
            stack.callback(database.close)
            artifacts = ArtifactStore(settings.artifacts_location, settings.artifact_options)
            yield Stores(database=database, url=url, artifacts=artifacts)
    except OperationalError as error:
        raise CommandError(f"the database can't be reached: {error.orig}") from error
    except (StartupError, StoreError) as error:
        raise CommandError(str(error)) from error


def _embedded(data: Path, stack: ExitStack, *, new: bool) -> str:
    folder = data / "postgres"
    if not new and not folder.is_dir():
        raise CommandError(
            f"{data} has no database: name its folder with --data, or set BUILDARENA_DATABASE_URL"
        )
    if is_running(data):
        url = None if new else url_of_running(folder)
        if url is None:
            raise CommandError(f"a service runs on {data}: stop it first, with `buildarena down`")
        return url
    try:
        (data / "logs").mkdir(parents=True, exist_ok=True)
        lock = stack.enter_context((data / LOCK).open("w"))
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise unwritable(data, error) from error
    postgres = EmbeddedPostgres(folder, data / "logs" / "postgres.log")
    process = postgres.start()
    stack.callback(postgres.stop, process)
    return postgres.url
