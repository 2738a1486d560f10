"""Checking a backup: every byte of it is read."""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_cli.backups.copying import AT_ONCE
from buildarena_cli.backups.place import DUMP, BackupPlace
from buildarena_cli.backups.restoring import read_list


def check_backup(place: BackupPlace, name: str) -> dict[str, str]:
    """Reads a backup: its dump, its list, and every artifact.

    Damaged artifacts go to the place's trash, so that the next backup copies them again.

    Args:
        place: Where it lies.
        name: Its name.

    Returns:
        What is wrong with which artifacts, by their hashes, those that were missing when it was
        made included.

    Raises:
        CommandError: There is no such backup, or its dump or list is damaged.
    """
    manifest = place.manifest(name)
    with tempfile.TemporaryDirectory(prefix="buildarena-check-") as folder:
        sizes = read_list(place, name, manifest, Path(folder) / DUMP)

    def problem_of(digest: str) -> str | None:
        try:
            size = len(place.artifacts.get(digest))
        except ArtifactMissingError as error:
            return str(error)
        except ArtifactDamagedError as error:
            place.artifacts.trash(digest)
            return str(error)
        if size != sizes[digest]:
            return f"artifact {digest} has {size:,} bytes, the list says {sizes[digest]:,}"
        return None

    with ThreadPoolExecutor(AT_ONCE) as pool:
        problems = dict(zip(sizes, pool.map(problem_of, sizes), strict=True))
    missing = {
        digest: f"artifact {digest} was missing when the backup was made"
        for digest in manifest.missing
    }
    return missing | {digest: problem for digest, problem in problems.items() if problem}
