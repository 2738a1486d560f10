"""Artifacts: large results, kept by the hash of their bytes in a folder or an S3 bucket."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import obstore
from obstore.store import LocalStore, ObjectStore, from_url

from buildarena_store.errors import ArtifactMissingError

HASH_LENGTH = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class ArtifactInfo:
    """What is known of stored bytes.

    Attributes:
        hash: SHA-256 of the bytes, 64 hex digits.
        media_type: For example ``application/json``.
        size: Length in bytes.
    """

    hash: str
    media_type: str
    size: int


class ArtifactStore:
    """Puts and gets bytes by content hash; what comes back is checked against the hash.

    Args:
        location: A folder, or a URL that obstore knows, for example ``s3://bucket/prefix``.
    """

    def __init__(self, location: str | Path) -> None:
        text = str(location)
        self._store: ObjectStore
        if "://" in text:
            self._store = from_url(text)
        else:
            self._store = LocalStore(prefix=Path(text).absolute(), mkdir=True)

    def put(self, data: bytes, media_type: str) -> ArtifactInfo:
        """Stores bytes; storing the same bytes again changes nothing."""
        digest = hashlib.sha256(data).hexdigest()
        obstore.put(self._store, _path(digest), data)
        return ArtifactInfo(hash=digest, media_type=media_type, size=len(data))

    def get(self, digest: str) -> bytes:
        """The bytes with this hash.

        Raises:
            ArtifactMissingError: They are not there, or they were damaged.
        """
        try:
            data = bytes(obstore.get(self._store, _path(digest)).bytes())
        except FileNotFoundError as error:
            raise ArtifactMissingError(f"artifact {digest} is not in the store") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise ArtifactMissingError(f"artifact {digest} is damaged: its bytes changed")
        return data


def _path(digest: str) -> str:
    if len(digest) != HASH_LENGTH or not set(digest) <= set("0123456789abcdef"):
        raise ArtifactMissingError(f"{digest!r} is not an artifact hash (64 hex digits)")
    return f"{digest[:2]}/{digest}"
