"""The folder of a dataset: written next to its destination, and moved when it is complete."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Final, Self

import pyarrow as pa
import pyarrow.parquet as pq

from buildarena_cli.dataset.card import CARD, FILE, Counts, card
from buildarena_cli.dataset.columns import schema
from buildarena_cli.dataset.messages import tools
from buildarena_cli.dataset.reading import Fetched
from buildarena_cli.dataset.rows import row_of
from buildarena_cli.errors import CommandError

GROUP_ROWS: Final = 256
GROUP_BYTES: Final = 16 << 20
"""Texts of a row group; at most so much and one row more is in memory."""
MAX_NAMED: Final = 3


def write_dataset(fetched: Iterable[Fetched], out: Path, *, licence: str) -> Counts:
    """Write jobs into a new folder, which appears when it is complete.

    Args:
        licence: Licence of the content by models, agents and people.

    Raises:
        CommandError: No job matches, or the folder can't be written.
    """
    definitions, counts = tools(), Counts()
    with new_folder(out) as folder:
        with Table(folder / FILE) as jobs:
            for job in fetched:
                row = row_of(job, tools=definitions, licence=licence)
                jobs.add(row)
                counts.add(row)
        if not counts.jobs:
            raise CommandError("none of the requested jobs has ended")
        (folder / CARD).write_text(card(counts), encoding="utf-8")
    return counts


def check_place(out: Path) -> None:
    """Check that a dataset can be written to a place.

    Raises:
        CommandError: Something is there already.
    """
    if out.exists() and not out.is_dir():
        raise CommandError(f"{out} is a file; with --dataset, --out names a folder")
    try:
        entries = sorted(entry.name for entry in out.iterdir()) if out.is_dir() else []
    except OSError as error:
        raise CommandError(f"{out} can't be read: {error.strerror}") from error
    if entries:
        named = ", ".join(entries[:MAX_NAMED]) + (" …" if len(entries) > MAX_NAMED else "")
        raise CommandError(f"{out} is not empty ({named}): name a new folder")


class Table:
    """A Parquet file that is written in row groups."""

    def __init__(self, path: Path) -> None:
        self._schema = schema()
        self._writer = pq.ParquetWriter(path, self._schema, compression="zstd")
        self._rows: list[Mapping[str, Any]] = []
        self._size = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self._flush()
        self._writer.close()

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a row."""
        self._rows.append(row)
        self._size += _size(row)
        if len(self._rows) >= GROUP_ROWS or self._size >= GROUP_BYTES:
            self._flush()

    def _flush(self) -> None:
        if self._rows:
            table = pa.Table.from_pylist(self._rows, schema=self._schema)
            self._writer.write_table(table, row_group_size=len(self._rows))
        self._rows, self._size = [], 0


def _size(value: Any) -> int:
    """Return the number of characters of all texts in a value."""
    if isinstance(value, str):
        return len(value)
    if isinstance(value, Mapping):
        return sum(map(_size, value.values()))
    return sum(map(_size, value)) if isinstance(value, list) else 0


@contextlib.contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder, and move it to its destination unless the block fails."""
    out = out.resolve()
    check_place(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(mkdtemp(prefix=f".{out.name}.", suffix=".partial", dir=out.parent))
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    try:
        yield partial
        # What mkdtemp makes is for its owner alone.
        partial.chmod(0o755)
        partial.replace(out)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
