"""Files that runners upload under their leases, kept next to the artifacts until a trial ends.

A file is the object ``uploads/JOB-TOKEN/SHA256``, so that every API process sees what another one
received, and a file that is sent twice is the same object. Nothing here is an artifact: what a
trial's outcome names becomes one when the outcome was accepted.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

import obstore

from buildarena_backend.artifacts.store import open_objects, translated
from buildarena_backend.errors import UploadError
from buildarena_backend.leases.leases import JobToken

MAX_FILE_BYTES: Final = 48 << 20
"""Largest file: a trial of the largest block-seconds has some 20 MB."""
MAX_LEASE_BYTES: Final = 96 << 20
"""Largest sum of what is uploaded under one lease."""
MAX_LEASE_FILES: Final = 16
_FOLDER: Final = "uploads"
_LEASE = re.compile(r"(job_[0-9a-f]+)-([0-9]+)")


class Uploads:
    """Keeps uploaded files, by lease.

    Args:
        options: Further settings of its store, as the artifact store's.
    """

    def __init__(self, location: str | Path, options: Mapping[str, str] | None = None) -> None:
        # In a folder they have their own subfolder, where emptied folders are removed.
        folder = "://" not in str(location)
        self._store = open_objects(
            Path(location) / _FOLDER if folder else location, options, folders_go=True
        )
        self._prefix = "" if folder else f"{_FOLDER}/"

    def keep(self, lease: JobToken, sha256: str, file: IO[bytes]) -> None:
        """Keep a file; one that was kept before stays the same.

        Args:
            lease: Lease under which it was received.
            sha256: Hash of its bytes, already verified, 64 hex digits.
            file: An open file, which is read from its start.

        Raises:
            UploadError: The lease may upload no more.
            ArtifactStoreError: The file can't be kept now.
        """
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        path = self._path(lease, sha256)
        stored_sizes = self._objects(_folder(lease))
        stored_sizes.pop(path, None)
        if len(stored_sizes) >= MAX_LEASE_FILES:
            raise UploadError(f"under one lease at most {MAX_LEASE_FILES} files are uploaded")
        total = sum(stored_sizes.values()) + size
        if total > MAX_LEASE_BYTES:
            raise UploadError(
                f"under one lease at most {MAX_LEASE_BYTES:,} bytes are uploaded, "
                f"these are {total:,}"
            )
        with translated("uploads can't be written"):
            obstore.put(self._store, path, file)

    def take(self, lease: JobToken, sha256: str) -> bytes:
        """Return the bytes of a file.

        Raises:
            UploadError: It was not uploaded under this lease.
            ArtifactStoreError: The store can't be read now.
        """
        with translated("uploads can't be read"):
            try:
                return bytes(obstore.get(self._store, self._path(lease, sha256)).bytes())
            except FileNotFoundError as error:
                raise UploadError(f"{sha256[:12]}… was not uploaded under this lease") from error

    def drop(self, lease: JobToken) -> None:
        """Remove everything that was uploaded under a lease."""
        for path in self._objects(_folder(lease)):
            with translated("uploads can't be written"), suppress(FileNotFoundError):
                obstore.delete(self._store, path)

    def leases(self) -> set[JobToken]:
        """Return the leases under which something is uploaded."""
        tokens = set()
        for path in self._objects(""):
            matched = _LEASE.fullmatch(path.removeprefix(self._prefix).partition("/")[0])
            if matched:
                tokens.add((matched[1], int(matched[2])))
        return tokens

    def _objects(self, folder: str) -> dict[str, int]:
        with translated("uploads can't be read"):
            listed = obstore.list(self._store, self._prefix + folder or None)
            return {entry["path"]: entry["size"] for batch in listed for entry in batch}

    def _path(self, lease: JobToken, sha256: str) -> str:
        return f"{self._prefix}{_folder(lease)}/{sha256}"


def _folder(lease: JobToken) -> str:
    job_id, token = lease
    return f"{job_id}-{token}"
