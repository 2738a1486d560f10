"""The members of an archive that is imported, read piece by piece: nothing in it is believed."""

from __future__ import annotations

import hashlib
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final, TypeVar

from pydantic import BaseModel, ValidationError

from buildarena_store.errors import StoreError

LARGEST_LINE: Final = 16 << 20
"""Bytes of one row: the longest transcripts and traces have some hundred kilobytes."""
LARGEST_ARTIFACT: Final = 256 << 20
LARGEST_ROWS: Final = 8 << 30
"""Bytes of all rows together, unpacked."""
LARGEST_ARTIFACTS: Final = 64 << 30
MAX_MEMBERS: Final = 1_000_000
ARTIFACT_NAME: Final = re.compile(r"artifacts/([0-9a-f]{64})")
SHOWN: Final = 3
"""Mistakes of a row that a refusal names."""

Row = TypeVar("Row", bound=BaseModel)


class ArchiveError(StoreError):
    """A file is not an archive that can be imported; nothing of it was stored."""


class Members:
    """An open archive. What is read is counted, whatever its headers say.

    Args:
        path: The file.

    Raises:
        ArchiveError: It is no ZIP file, or has too many or doubled members.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._archive = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise ArchiveError(f"this is not a valid archive of a sweep: {error}") from error
        names = Counter(self._archive.namelist())
        if len(names) > MAX_MEMBERS:
            raise ArchiveError(f"it has more than {MAX_MEMBERS:,} members")
        doubled = [name for name, number in names.items() if number > 1]
        if doubled:
            raise ArchiveError(f"it has two members {doubled[0][:100]!r}")
        self._rows_left, self._artifacts_left = LARGEST_ROWS, LARGEST_ARTIFACTS

    def close(self) -> None:
        """Closes the file."""
        self._archive.close()

    @property
    def artifacts(self) -> set[str]:
        """Hashes that artifacts in it are named by; members with other names are never opened."""
        matches = map(ARTIFACT_NAME.fullmatch, self._archive.namelist())
        return {match[1] for match in matches if match}

    def rows(self, name: str, kind: type[Row]) -> Iterator[Row]:
        """The rows of a table, each checked.

        Raises:
            ArchiveError: A row is not what this table may hold.
        """
        for number, line in enumerate(self._lines(f"rows/{name}.jsonl"), 1):
            try:
                yield kind.model_validate_json(line)
            except ValidationError as error:
                raise ArchiveError(f"row {number} of {name}: {_spelled(error)}") from error

    def manifest(self, kind: type[Row]) -> Row:
        """What the archive says of itself.

        Raises:
            ArchiveError: It says nothing that can be read.
        """
        try:
            return kind.model_validate_json(self._bytes("manifest.json", LARGEST_LINE))
        except ValidationError as error:
            raise ArchiveError(f"manifest.json: {_spelled(error)}") from error

    def artifact(self, digest: str) -> bytes:
        """The bytes of an artifact.

        Raises:
            ArchiveError: They are too many, or others than their name says.
        """
        limit = min(LARGEST_ARTIFACT, self._artifacts_left)
        data = self._bytes(f"artifacts/{digest}", limit)
        self._artifacts_left -= len(data)
        if hashlib.sha256(data).hexdigest() != digest:
            raise ArchiveError(f"artifact {digest} was changed")
        return data

    def _bytes(self, name: str, limit: int) -> bytes:
        with self._opened(name) as member:
            data = _read(member, limit + 1, name)
        if len(data) > limit:
            raise ArchiveError(f"{name} is larger than {limit:,} bytes")
        return data

    def _lines(self, name: str) -> Iterator[bytes]:
        with self._opened(name) as member:
            while True:
                try:
                    line = member.readline(LARGEST_LINE + 1)
                except (zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
                    raise ArchiveError(f"{name} is damaged: {error}") from error
                if not line:
                    return
                self._rows_left -= len(line)
                if len(line) > LARGEST_LINE:
                    raise ArchiveError(f"a row of {name} is larger than {LARGEST_LINE:,} bytes")
                if self._rows_left < 0:
                    raise ArchiveError(f"its rows are larger than {LARGEST_ROWS:,} bytes")
                yield line

    def _opened(self, name: str) -> IO[bytes]:
        try:
            return self._archive.open(name)
        except KeyError as error:
            raise ArchiveError(
                f"this is not a valid archive of a sweep: it has no {name}"
            ) from error
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError) as error:
            raise ArchiveError(f"{name} can't be opened: {error}") from error


def _read(member: IO[bytes], size: int, name: str) -> bytes:
    try:
        return member.read(size)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
        raise ArchiveError(f"{name} is damaged: {error}") from error


def _spelled(error: ValidationError) -> str:
    """The first mistakes, with the fields they are in."""
    found = [
        f"{'.'.join(map(str, item['loc']))}: {item['msg'].removeprefix('Value error, ')}".lstrip(
            ": "
        )
        for item in error.errors(include_url=False, include_input=False)
    ]
    return "; ".join(found[:SHOWN]) + ("; …" if len(found) > SHOWN else "")
