"""Uploads under way: bytes that runners send in pieces, kept beside the artifacts.

A piece is an object of its own, ``uploads/JOB-TOKEN/HASH-SIZE-INDEX``, so that every API process
sees what another one received, and a piece that comes twice is the same object. Nothing here is an
artifact: what is whole and sound is put there by whoever asked for it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import obstore
from obstore.exceptions import BaseError

from buildarena_backend.artifacts.storing import open_objects
from buildarena_backend.errors import ArtifactStoreError, UploadError
from buildarena_backend.leases.runner_leases import JobToken

PIECE_BYTES: Final = 1 << 20
"""Every piece has so many bytes, but for the last."""
MAX_FILE_BYTES: Final = 48 << 20
"""Largest file: a trial of the largest block-seconds has some 20 MB."""
MAX_LEASE_BYTES: Final = 96 << 20
"""Largest sum of what is uploaded under one lease."""
MAX_LEASE_FILES: Final = 16
_FOLDER: Final = "uploads"
_LEASE = re.compile(r"(job_[0-9a-f]+)-([0-9]+)")
_PIECE = re.compile(r"([0-9a-f]{64})-([0-9]+)-([0-9]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadedFile:
    """A file that is uploaded.

    Attributes:
        sha256: Of its bytes, 64 hex digits.
        size: Its length, bytes.
    """

    sha256: str
    size: int

    @property
    def pieces(self) -> int:
        """Of how many pieces it consists."""
        return max(1, -(-self.size // PIECE_BYTES))


class Uploads:
    """Receives files in pieces, by lease.

    Args:
        location: That of the artifact store.
        options: Further settings of its store, as the artifact store's.
    """

    def __init__(self, location: str | Path, options: Mapping[str, str] | None = None) -> None:
        # In a folder they have one of their own, where emptied folders go by themselves.
        folder = "://" not in str(location)
        self._store = open_objects(
            Path(location) / _FOLDER if folder else location, options, folders_go=True
        )
        self._prefix = "" if folder else f"{_FOLDER}/"

    def offset(self, lease: JobToken, file: UploadedFile) -> int:
        """How many bytes of a file have been received from its start.

        Raises:
            ArtifactStoreError: The store can't be read now.
        """
        return self._received(self._sizes(lease), file)

    def append(self, lease: JobToken, file: UploadedFile, offset: int, data: bytes) -> int:
        """Keeps the piece of a file that begins at an offset; one that was kept changes nothing.

        Returns:
            How many bytes have been received now: where the next piece begins.

        Raises:
            UploadError: The piece is not one of this file's, or does not follow what was received,
                or the lease may upload no more.
            ArtifactStoreError: The piece can't be kept now.
        """
        index, rest = divmod(offset, PIECE_BYTES)
        wanted = min(PIECE_BYTES, file.size - offset)
        if rest or wanted < 0 or (wanted == 0 and file.size):
            raise UploadError(
                f"no piece of {file.size:,} bytes begins at {offset:,}: pieces begin at multiples "
                f"of {PIECE_BYTES:,}"
            )
        if len(data) != wanted:
            raise UploadError(
                f"the piece at {offset:,} of {file.size:,} bytes has {wanted:,}, not {len(data):,}"
            )
        sizes = self._sizes(lease)
        received = self._received(sizes, file)
        if offset < received:
            return received
        if offset > received:
            raise UploadError(f"{received:,} bytes were received: go on there, not at {offset:,}")
        _require_room(sizes, file)
        with _translated("written"):
            obstore.put(self._store, self._path(lease, file, index), data)
        return offset + len(data)

    def take(self, lease: JobToken, file: UploadedFile) -> bytes:
        """The bytes of a file that was received whole.

        Raises:
            UploadError: Something is missing, or they are other bytes than their hash says; these
                are removed, to be sent again.
            ArtifactStoreError: The store can't be read now.
        """
        received = self.offset(lease, file)
        paths = [self._path(lease, file, index) for index in range(file.pieces)]
        if received < file.size or not paths:
            raise UploadError(
                f"of {file.sha256[:12]}… only {received:,} of {file.size:,} bytes were received"
            )
        try:
            with _translated("read"):
                data = b"".join(bytes(obstore.get(self._store, path).bytes()) for path in paths)
        except FileNotFoundError as error:
            raise UploadError(f"of {file.sha256[:12]}… not all pieces were received") from error
        if hashlib.sha256(data).hexdigest() != file.sha256:
            self._delete(paths)
            raise UploadError(
                f"what was received as {file.sha256[:12]}… has another SHA-256: send it again"
            )
        return data

    def drop(self, lease: JobToken) -> None:
        """Removes everything that was uploaded under a lease."""
        self._delete(self._objects(_folder(lease)))

    def leases(self) -> set[JobToken]:
        """The leases under which something is uploaded."""
        found = set()
        for path in self._objects(""):
            matched = _LEASE.fullmatch(path.removeprefix(self._prefix).partition("/")[0])
            if matched:
                found.add((matched[1], int(matched[2])))
        return found

    def _sizes(self, lease: JobToken) -> Mapping[tuple[str, int, int], int]:
        """Bytes of each piece of a lease, by hash, size and index."""
        found = {}
        for path, size in self._objects(_folder(lease)).items():
            matched = _PIECE.fullmatch(path.rpartition("/")[2])
            if matched:
                found[matched[1], int(matched[2]), int(matched[3])] = size
        return found

    @staticmethod
    def _received(sizes: Mapping[tuple[str, int, int], int], file: UploadedFile) -> int:
        received = 0
        for index in range(file.pieces):
            size = sizes.get((file.sha256, file.size, index))
            if size is None:
                break
            received += size
        return received

    def _objects(self, folder: str) -> dict[str, int]:
        with _translated("read"):
            listed = obstore.list(self._store, self._prefix + folder or None)
            return {entry["path"]: entry["size"] for batch in listed for entry in batch}

    def _path(self, lease: JobToken, file: UploadedFile, index: int) -> str:
        return f"{self._prefix}{_folder(lease)}/{file.sha256}-{file.size}-{index}"

    def _delete(self, paths: Iterable[str]) -> None:
        for path in paths:
            with suppress(FileNotFoundError), _translated("written"):
                obstore.delete(self._store, path)


@contextmanager
def _translated(done: str) -> Iterator[None]:
    """Turns errors of the object store into ours, but for objects that are not there."""
    try:
        yield
    except FileNotFoundError:
        raise
    except (BaseError, OSError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        raise ArtifactStoreError(f"uploads can't be {done}: {reason}") from error


def _folder(lease: JobToken) -> str:
    job_id, token = lease
    return f"{job_id}-{token}"


def _require_room(sizes: Mapping[tuple[str, int, int], int], file: UploadedFile) -> None:
    if file.size > MAX_FILE_BYTES:
        raise UploadError(f"a file has at most {MAX_FILE_BYTES:,} bytes, this {file.size:,}")
    files = {(sha256, size) for sha256, size, _ in sizes} | {(file.sha256, file.size)}
    if len(files) > MAX_LEASE_FILES:
        raise UploadError(f"under one lease at most {MAX_LEASE_FILES} files are uploaded")
    total = sum(size for _, size in files)
    if total > MAX_LEASE_BYTES:
        raise UploadError(
            f"under one lease at most {MAX_LEASE_BYTES:,} bytes are uploaded, these are {total:,}"
        )
