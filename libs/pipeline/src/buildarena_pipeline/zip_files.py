"""Reads ZIP files that strangers send: bounded, and no header believed."""

from __future__ import annotations

import io
import stat
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

_ENCRYPTED: Final = 0x1
_UNSOUND: Final = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    NotImplementedError,
    OSError,
    RuntimeError,
    ValueError,
)


class ZipFileError(ValueError):
    """It is no sound ZIP file, or breaks a bound; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZipBounds:
    """How large a file may be that is read.

    Attributes:
        members: Most files in it.
        unpacked_bytes: All of them together.
        ratio: How many times as large as its packed bytes a member may be.
        small_bytes: Up to this size a member's ratio is not looked at.
    """

    members: int
    unpacked_bytes: int
    ratio: int = 200
    small_bytes: int = 64 << 10


def zip_members(
    data: bytes,
    bounds: ZipBounds,
    *,
    limit_of: Callable[[str], int],
    unread: frozenset[str] = frozenset(),
) -> dict[str, bytes]:
    """The members of a ZIP file by name, folders left out.

    Args:
        data: The file.
        bounds: What it may have.
        limit_of: The most bytes of a member by its name; raises where none may be called so.
        unread: Members that are looked at and not unpacked.

    Raises:
        ZipFileError: It is no sound ZIP file, or breaks a bound.
    """
    with _sound(), zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = archive.infolist()
    _require_sound(entries, bounds, limit_of)
    with _sound(), zipfile.ZipFile(io.BytesIO(data)) as archive:
        return _unpacked(archive, [entry for entry in entries if entry.filename not in unread])


@contextmanager
def _sound() -> Iterator[None]:
    try:
        yield
    except ZipFileError:
        raise
    except _UNSOUND as error:
        raise ZipFileError(f"it is no sound ZIP file: {error}") from error


def _require_sound(
    entries: list[zipfile.ZipInfo], bounds: ZipBounds, limit_of: Callable[[str], int]
) -> None:
    if len(entries) > bounds.members:
        raise ZipFileError(f"it has {len(entries):,} members: at most {bounds.members:,} are read")
    twice = [name for name, n in Counter(entry.filename for entry in entries).items() if n > 1]
    if twice:
        raise ZipFileError(f"it has two members {twice[0][:100]!r}")
    total = 0
    for entry in entries:
        if not entry.is_dir():
            _require_member(entry, bounds, limit_of(entry.filename))
        total += entry.file_size
        if total > bounds.unpacked_bytes:
            raise ZipFileError(f"unpacked it has more than {bounds.unpacked_bytes:,} bytes")


def _require_member(entry: zipfile.ZipInfo, bounds: ZipBounds, limit: int) -> None:
    name = entry.filename[:100]
    if stat.S_IFMT(entry.external_attr >> 16) not in {0, stat.S_IFREG}:
        raise ZipFileError(f"{name} is no ordinary file")
    if entry.flag_bits & _ENCRYPTED:
        raise ZipFileError(f"{name} is encrypted")
    if entry.file_size > limit:
        raise ZipFileError(f"{name} has {entry.file_size:,} bytes: at most {limit:,} are read")
    if entry.file_size > max(bounds.small_bytes, bounds.ratio * entry.compress_size):
        raise ZipFileError(f"{name} is more than {bounds.ratio} times as large as it is packed")


def _unpacked(archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo]) -> dict[str, bytes]:
    """The members; what is read is counted, whatever headers say."""
    members = {}
    for entry in entries:
        if entry.is_dir():
            continue
        with archive.open(entry) as member:
            content = member.read(entry.file_size + 1)
        if len(content) != entry.file_size:
            raise ZipFileError(f"{entry.filename} is not as large as it says")
        members[entry.filename] = content
    return members
