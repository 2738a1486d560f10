"""The place of backups: a folder or a bucket that holds several, and shares their artifacts.

::

    artifacts/ab/ab12…          by the hash of their bytes, each once for all backups
    2026-11-22T09-30-00Z/database.dump    as pg_dump's custom format
    2026-11-22T09-30-00Z/artifacts.txt    a line "hash size" for each artifact
    2026-11-22T09-30-00Z/manifest.json    written last: without it, the backup is not whole
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import obstore
from obstore.exceptions import BaseError

from buildarena_backend.artifacts.store import ArtifactStore, open_objects
from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError
from buildarena_cli.errors import CommandError

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")
MANIFEST: Final = "manifest.json"
DUMP: Final = "database.dump"
LIST: Final = "artifacts.txt"
FORMAT: Final = 1
CHUNK_BYTES: Final = 8 * 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Description of a backup.

    Attributes:
        format: Version of the backup's format.
        version: Version of BuildArena.
        schema: Revision of the database.
        made_at: Time of the snapshot, UTC.
        dump_sha256: Hash of the dump.
        list_sha256: Hash of the list of artifacts.
        artifacts: Number of artifacts.
        artifact_bytes: Total size of the artifacts, bytes.
        missing: Referenced artifacts that the store did not have.
    """

    format: int
    version: str
    schema: str
    made_at: str
    dump_sha256: str
    list_sha256: str
    artifacts: int
    artifact_bytes: int
    missing: Sequence[str]


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
            self.artifacts = ArtifactStore(f"{location.rstrip('/')}/artifacts", options)
        except (OSError, BaseError) as error:
            raise CommandError(f"{location} can't be used for backups: {error}") from error

    def names(self) -> list[str]:
        """Return the names of the complete backups, the oldest first."""
        return sorted(
            path.split("/")[0]
            for path in self._paths()
            if path.count("/") == 1 and path.endswith(f"/{MANIFEST}")
        )

    def manifest(self, name: str) -> Manifest:
        """Return the manifest of a backup.

        Raises:
            CommandError: The place has no complete backup of this name, or it has another format.
        """
        names = self.names()
        if name not in names:
            choices = ", ".join(names[-5:]) or "none"
            raise CommandError(
                f"{self.location} has no complete backup {name!r}; the newest are: {choices}"
            )
        fields: dict[str, Any] = json.loads(self.read(f"{name}/{MANIFEST}"))
        if fields.get("format") != FORMAT:
            raise CommandError(f"backup {name} has the format {fields.get('format')}, not {FORMAT}")
        return Manifest(**fields)

    def finish(self, name: str, manifest: Manifest) -> None:
        """Write the manifest, which completes the backup."""
        self.write(f"{name}/{MANIFEST}", json.dumps(asdict(manifest), indent=2).encode())

    def read(self, path: str) -> bytes:
        """Return a small file."""
        return bytes(obstore.get(self._store, path).bytes())

    def write(self, path: str, data: bytes) -> None:
        """Write a small file."""
        obstore.put(self._store, path, data)

    def send(self, path: str, file: Path) -> None:
        """Write a file of any size, in chunks."""
        obstore.put(self._store, path, file)

    def fetch(self, path: str, file: Path) -> str:
        """Read a file of any size into another; return its SHA-256."""
        digest = hashlib.sha256()
        with file.open("wb") as out:
            for chunk in obstore.get(self._store, path).stream(min_chunk_size=CHUNK_BYTES):
                digest.update(chunk)
                out.write(chunk)
        return digest.hexdigest()

    def _paths(self) -> Iterator[str]:
        # The folder of artifacts is large and contains no backups.
        for folder in obstore.list_with_delimiter(self._store)["common_prefixes"]:
            if folder.rstrip("/") != "artifacts":
                for item in obstore.list_with_delimiter(self._store, folder)["objects"]:
                    yield str(item["path"])


AT_ONCE: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Copied:
    """Result of a copy.

    Attributes:
        sizes: Sizes of the artifacts in the target, bytes, by hash.
        missing: Errors of the artifacts that could not be copied, by hash.
        new: Number of artifacts that were copied.
    """

    sizes: dict[str, int]
    missing: dict[str, str]
    new: int


def copy_artifacts(
    source: ArtifactStore, target: ArtifactStore, sizes: Mapping[str, int | None]
) -> Copied:
    """Copy the artifacts that the target lacks or has in another size, and check their hashes.

    Args:
        sizes: Sizes of the artifacts, bytes, by hash; None if unknown.

    Raises:
        ArtifactStoreError: A store can't be read or written now.
    """
    stored = {item.hash: item.size for item in target.all()}
    complete = {
        digest
        for digest, size in sizes.items()
        if digest in stored and size in {None, stored[digest]}
    }

    def size_of(digest: str) -> int | str:
        if digest in complete:
            return stored[digest]
        try:
            data = source.get(digest)
        except (ArtifactMissingError, ArtifactDamagedError) as error:
            return str(error)
        return target.put(data, "").size

    with ThreadPoolExecutor(AT_ONCE) as pool:
        outcomes = dict(zip(sizes, pool.map(size_of, sizes), strict=True))
    copied = {digest: size for digest, size in outcomes.items() if isinstance(size, int)}
    return Copied(
        sizes=copied,
        missing={
            digest: problem for digest, problem in outcomes.items() if isinstance(problem, str)
        },
        new=sum(digest not in complete for digest in copied),
    )
