"""Artifacts: large results, kept by the hash of their bytes in a folder or an S3 bucket."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Final, cast

import obstore
from obstore.exceptions import BaseError
from obstore.store import LocalStore, ObjectStore, from_url

from buildarena_backend.errors import ArtifactDamagedError, ArtifactMissingError, ArtifactStoreError

if TYPE_CHECKING:
    from obstore.store import ClientConfig, S3Config

CLOUDS: Final = ("s3://", "s3a://", "gs://", "az://", "adl://", "abfs://", "abfss://", "https://")
"""Prefixes of URLs of stores that are reached over the network."""
CLIENT_OPTIONS: Final = (
    "allow_http",
    "allow_invalid_certificates",
    "connect_timeout",
    "proxy_ca_certificate",
    "proxy_excludes",
    "proxy_url",
    "timeout",
)
"""Connection options that the environment may set (obstore's names)."""
HASH_LENGTH: Final = 64
TRASH: Final = "trash"
PROBE_BYTES: Final = 64 * 1024
"""About what a session keeps: a store that is full to the last block fails already."""
CONNECT_S: Final = 3.0
"""Limit of a bucket's server to accept a connection."""
TIMEOUT_S: Final = 30.0
"""Limit of one request to a bucket; large artifacts are sent in parts."""


def open_objects(
    location: str | Path,
    options: Mapping[str, str] | None = None,
    *,
    folders_go: bool = False,
    timeout_s: float = TIMEOUT_S,
) -> ObjectStore:
    """Open an object store.

    Args:
        location: A folder, which is made if need be, or a URL that obstore supports, for example
            ``s3://bucket/prefix``.
        options: Further settings of such a URL's store, for example ``AWS_SECRET_ACCESS_KEY``;
            they go before those of the environment.
        folders_go: Whether folders inside a folder go with what was last in them.
        timeout_s: Limit of one request to such a store; with its repetitions twice that.
    """
    text = str(location)
    if "://" in text:
        if text.startswith(CLOUDS):
            return from_url(
                text,
                config=cast("S3Config", dict(options)) if options else None,
                client_options=_client_options(text, options or {}, timeout_s),
                retry_config={"max_retries": 3, "retry_timeout": timedelta(seconds=timeout_s)},
            )
        return from_url(text)
    return LocalStore(prefix=Path(text).absolute(), mkdir=True, automatic_cleanup=folders_go)


def _client_options(location: str, options: Mapping[str, str], timeout_s: float) -> ClientConfig:
    """Return time limits with the environment's connection options, which they would hide."""
    is_s3 = location.startswith(("s3://", "s3a://"))
    names = {f"AWS_{name.upper()}": name for name in CLIENT_OPTIONS} if is_s3 else {}
    values = {**os.environ, **options}
    return cast(
        "ClientConfig",
        {
            "connect_timeout": f"{min(CONNECT_S, timeout_s):g} seconds",
            "timeout": f"{timeout_s:g} seconds",
            **{names[name]: value for name, value in values.items() if name in names},
        },
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArtifactInfo:
    """Metadata of stored bytes.

    Attributes:
        hash: SHA-256 of the bytes, 64 hex digits.
        media_type: For example ``application/json``.
        size: Length in bytes.
    """

    hash: str
    media_type: str
    size: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredArtifact:
    """Metadata of an object in a store, without its content.

    Attributes:
        hash: The hash in its name.
        size: Length in bytes.
    """

    hash: str
    size: int
    stored_at: datetime


class ArtifactStore:
    """Puts and gets bytes by content hash; returned bytes are checked against the hash.

    Args:
        location: A folder, or a URL that obstore supports, for example ``s3://bucket/prefix``.
        options: Further settings of such a URL's store, for example ``AWS_SECRET_ACCESS_KEY``;
            they go before those of the environment.
    """

    def __init__(
        self,
        location: str | Path,
        options: Mapping[str, str] | None = None,
        *,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self._location = str(location).partition("?")[0]
        self._store = open_objects(location, options, timeout_s=timeout_s)

    def put(self, data: bytes, media_type: str) -> ArtifactInfo:
        """Store bytes; storing the same bytes again changes nothing, or repairs them.

        Raises:
            ArtifactStoreError: They can't be stored now: a full disk, a bucket out of reach.
        """
        digest = hashlib.sha256(data).hexdigest()
        with self._translated("written"):
            obstore.put(self._store, _path(digest), data)
        return ArtifactInfo(hash=digest, media_type=media_type, size=len(data))

    def get(self, digest: str) -> bytes:
        """Return the bytes with this hash.

        Raises:
            ArtifactMissingError: They are not there.
            ArtifactDamagedError: They are not what was stored.
            ArtifactStoreError: The store can't be read now.
        """
        with self._translated("read"):
            try:
                data = bytes(obstore.get(self._store, _path(digest)).bytes())
            except FileNotFoundError as error:
                raise ArtifactMissingError(f"artifact {digest} is not in the store") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise ArtifactDamagedError(f"artifact {digest} is damaged: its bytes changed")
        return data

    def all(self, prefix: str = "", *, trashed: bool = False) -> Iterator[StoredArtifact]:
        """Yield stored artifacts in no order; other objects are skipped.

        Args:
            prefix: Only hashes that begin with these two digits.
            trashed: True to list the trash instead.

        Raises:
            ArtifactStoreError: The store can't be read now.
        """
        with self._translated("listed"):
            where = "/".join(filter(None, (TRASH if trashed else "", prefix)))
            for chunk in obstore.list(self._store, prefix=where or None):
                for item in chunk:
                    path = str(item["path"]).removeprefix(f"{TRASH}/" if trashed else "")
                    digest = path[-HASH_LENGTH:]
                    if _is_hash(digest) and path == _path(digest):
                        yield StoredArtifact(
                            hash=digest, size=item["size"], stored_at=item["last_modified"]
                        )

    def trash(self, digest: str) -> None:
        """Move bytes where `get` does not find them; `restore` undoes it.

        Raises:
            ArtifactStoreError: The store can't be written now.
        """
        self._move(_path(digest), f"{TRASH}/{_path(digest)}")

    def restore(self, digest: str) -> None:
        """Move bytes out of the trash; errors as for `trash`."""
        self._move(f"{TRASH}/{_path(digest)}", _path(digest))

    def delete_trashed(self, digest: str) -> None:
        """Delete bytes that lie in the trash; errors as for `trash`."""
        with self._translated("deleted"):
            obstore.delete(self._store, f"{TRASH}/{_path(digest)}")

    def _move(self, old: str, new: str) -> None:
        # A copy and a deletion: a rename would keep the time at which it was written, and the trash
        # counts from the time of the move.
        with self._translated("moved"):
            try:
                data = obstore.get(self._store, old).bytes()
            except FileNotFoundError:
                return
            obstore.put(self._store, new, data)
            obstore.delete(self._store, old)

    def probe(self) -> None:
        """Write and read something, to see whether the store works.

        Raises:
            ArtifactStoreError: It does not; the message has the reason.
        """
        path, data = f"probe/{secrets.token_hex(8)}", secrets.token_bytes(PROBE_BYTES)
        with self._translated("written"):
            obstore.put(self._store, path, data)
        try:
            with self._translated("read"):
                if bytes(obstore.get(self._store, path).bytes()) != data:
                    raise ArtifactStoreError(f"{self._location} gives back other bytes than given")
        finally:
            with self._translated("written"):
                obstore.delete(self._store, path)

    def _translated(self, done: str) -> AbstractContextManager[None]:
        return translated(f"artifacts can't be {done} in {self._location}")


@contextmanager
def translated(problem: str) -> Iterator[None]:
    """Raise errors of the object store as `ArtifactStoreError`, with the problem before them."""
    try:
        yield
    except (BaseError, OSError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        raise ArtifactStoreError(f"{problem}: {reason}") from error


def _is_hash(text: str) -> bool:
    return len(text) == HASH_LENGTH and set(text) <= set("0123456789abcdef")


def _path(digest: str) -> str:
    if not _is_hash(digest):
        raise ArtifactMissingError(f"{digest!r} is not an artifact hash (64 hex digits)")
    return f"{digest[:2]}/{digest}"
