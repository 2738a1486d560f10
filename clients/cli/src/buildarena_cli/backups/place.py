"""The place of backups: a folder or a bucket that holds several, and shares their artifacts.

::

    artifacts/ab/ab12…          by the hash of their bytes, each once for all backups
    2026-11-22T09-30-00Z/database.dump    as pg_dump's custom format
    2026-11-22T09-30-00Z/manifest.json    written last: without it, the backup is not whole
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import obstore
from obstore.exceptions import BaseError

from buildarena_backend.artifacts.store import ArtifactStore, open_objects
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_cli.errors import CommandError

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")
ARTIFACTS: Final = "artifacts"
MANIFEST: Final = "manifest.json"
DUMP: Final = "database.dump"
FORMAT: Final = 2
CHUNK_BYTES: Final = 8 * 1024 * 1024
AT_ONCE: Final = 8
"""Artifacts that are read or copied at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Description of a backup.

    Attributes:
        format: Version of the backup's format.
        version: Version of BuildArena.
        schema: Revision of the database.
        created_at: Time of the snapshot, UTC.
        dump_sha256: Hash of the dump.
        sizes: Sizes of the artifacts by hash, bytes.
        missing: Referenced artifacts that the store did not have.
    """

    name: str
    format: int
    version: str
    schema: str
    created_at: str
    dump_sha256: str
    sizes: Mapping[str, int]
    missing: Sequence[str]

    def summary(self) -> dict[str, Any]:
        """Return the description with the number and total size of the artifacts."""
        fields = asdict(self)
        sizes = fields.pop("sizes")
        return {**fields, "artifacts": len(sizes), "artifact_bytes": sum(sizes.values())}


class BackupPlace:
    """Folder of backups.

    Args:
        location: A folder, or a URL such as ``s3://bucket/prefix``.
        options: Settings of such a URL's store, for example its credentials.
    """

    def __init__(self, location: str, options: Mapping[str, str]) -> None:
        self.location = location
        try:
            if "://" not in location:
                Path(location).mkdir(parents=True, exist_ok=True, mode=0o700)
            self._store = open_objects(location, options)
            self.artifacts = ArtifactStore(f"{location.rstrip('/')}/{ARTIFACTS}", options)
        except (OSError, BaseError) as error:
            raise CommandError(f"{location} can't be used for backups: {error}") from error

    def names(self) -> list[str]:
        """Return the names of the complete backups, the oldest first."""
        # The folder of artifacts is large and contains no backups.
        folders = obstore.list_with_delimiter(self._store)["common_prefixes"]
        names = {folder.rstrip("/") for folder in folders} - {ARTIFACTS}
        return sorted(name for name in names if self._is_complete(name))

    def _is_complete(self, name: str) -> bool:
        files = obstore.list_with_delimiter(self._store, name)["objects"]
        return any(file["path"] == f"{name}/{MANIFEST}" for file in files)

    def manifest(self, name: str | None = None) -> Manifest:
        """Return the manifest of a backup, by default of the newest.

        Raises:
            CommandError: The place has no complete backup of this name, or it has another format.
        """
        names = self.names()
        if not names:
            raise CommandError(f"{self.location} has no complete backup")
        name = name or names[-1]
        if name not in names:
            raise CommandError(
                f"{self.location} has no complete backup {name!r}; the newest are: "
                f"{', '.join(names[-5:])}"
            )
        fields = json.loads(bytes(obstore.get(self._store, f"{name}/{MANIFEST}").bytes()))
        if fields.get("format") != FORMAT:
            raise CommandError(f"backup {name} has the format {fields.get('format')}, not {FORMAT}")
        return Manifest(**fields)

    def send(self, name: str, dump: Path) -> None:
        """Write a backup's dump, in chunks."""
        obstore.put(self._store, f"{name}/{DUMP}", dump)

    def finish(self, manifest: Manifest) -> None:
        """Write the manifest, which completes the backup."""
        text = json.dumps(asdict(manifest), indent=1)
        obstore.put(self._store, f"{manifest.name}/{MANIFEST}", text.encode())

    def fetch(self, manifest: Manifest, dump: Path) -> None:
        """Read a backup's dump into a file.

        Raises:
            CommandError: The dump can't be read, or is damaged.
        """
        path, digest = f"{manifest.name}/{DUMP}", sha256()
        try:
            with dump.open("wb") as out:
                for chunk in obstore.get(self._store, path).stream(min_chunk_size=CHUNK_BYTES):
                    digest.update(chunk)
                    out.write(chunk)
        except (BaseError, OSError) as error:
            raise CommandError(f"{path} can't be read: {error}") from error
        if digest.hexdigest() != manifest.dump_sha256:
            raise CommandError(f"{path} is damaged: its SHA-256 is {digest.hexdigest()}")


def copy_artifacts(
    source: ArtifactStore, target: ArtifactStore, sizes: Mapping[str, int | None]
) -> tuple[dict[str, int], dict[str, str], int]:
    """Copy the artifacts that the target lacks or has in another size, and check their hashes.

    Args:
        sizes: Sizes of the artifacts, bytes, by hash; None if unknown.

    Returns:
        Sizes of the artifacts in the target by hash; errors of those that could not be copied;
        the number of those that were copied.

    Raises:
        ArtifactStoreError: A store can't be read or written now.
    """
    stored = {item.hash: item.size for item in target.all()}
    complete = {d for d, size in sizes.items() if d in stored and size in {None, stored[d]}}

    def copy(digest: str) -> int | str:
        try:
            return target.put(source.get(digest), "").size
        except (ArtifactMissingError, ArtifactDamagedError) as error:
            return str(error)

    lacking = [digest for digest in sizes if digest not in complete]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        outcomes = dict(zip(lacking, pool.map(copy, lacking), strict=True))
    copied = {digest: size for digest, size in outcomes.items() if isinstance(size, int)}
    missing = {digest: error for digest, error in outcomes.items() if isinstance(error, str)}
    return {digest: stored[digest] for digest in complete} | copied, missing, len(copied)
