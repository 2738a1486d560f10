"""What somebody hands in: the files of a folder or of a ZIP file, bounded."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from buildarena_pipeline.zip_files import ZipBounds, ZipFileError, zip_members

MAX_BYTES: Final = 64 << 20
"""Of a ZIP file."""
MAX_FILE_BYTES: Final = 16 << 20
_BOUNDS: Final = ZipBounds(members=100, unpacked_bytes=64 << 20)


class PackageError(ValueError):
    """There is no package that can be read; the message says why."""


@dataclass(frozen=True, slots=True)
class Package:
    """The files that were handed in.

    Attributes:
        files: Their bytes, by name.
    """

    files: Mapping[str, bytes] = field(repr=False)


def read_package(path: Path) -> Package:
    """The package of a folder or a ZIP file.

    Args:
        path: Where it is.

    Raises:
        PackageError: It is neither, or breaks a bound.
    """
    try:
        if path.is_dir():
            return Package(_of_folder(path))
        with path.open("rb") as file:
            return packed_package(file.read(MAX_BYTES + 1))
    except OSError as error:
        raise PackageError(f"{path}: {error.strerror}") from error


def zipped_package(path: Path) -> bytes:
    """The bytes of a package as a ZIP file: of a folder's files equal ones have equal bytes.

    Args:
        path: A folder, or a ZIP file, which is left as it is.

    Raises:
        PackageError: It is neither, or breaks a bound.
    """
    if not path.is_dir():
        read_package(path)
        return path.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(read_package(path).files.items()):
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def packed_package(data: bytes) -> Package:
    """The package of a ZIP file's bytes; its files may lie in one folder.

    Raises:
        PackageError: It is no sound ZIP file, or breaks a bound.
    """
    if len(data) > MAX_BYTES:
        raise PackageError(f"it has more than {MAX_BYTES:,} bytes, which is the most that is read")
    try:
        members = zip_members(data, _BOUNDS, limit_of=lambda _: MAX_FILE_BYTES)
    except ZipFileError as error:
        raise PackageError(str(error)) from error
    folders = {name.partition("/")[0] for name in members if "/" in name}
    if len(folders) == 1 and all("/" in name for name in members):
        members = {name.partition("/")[2]: content for name, content in members.items()}
    return Package(members)


def _of_folder(folder: Path) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            size = entry.stat(follow_symlinks=False).st_size
            if not stat.S_ISREG(entry.stat(follow_symlinks=False).st_mode):
                raise PackageError(f"{entry.name} is no ordinary file")
            if size > MAX_FILE_BYTES:
                raise PackageError(
                    f"{entry.name} has {size:,} bytes: at most {MAX_FILE_BYTES:,} are read"
                )
            if len(files) >= _BOUNDS.members:
                raise PackageError(f"it has more than {_BOUNDS.members} files")
            files[entry.name] = Path(entry.path).read_bytes()
    return files
