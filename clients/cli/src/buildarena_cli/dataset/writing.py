"""The folder of a dataset: written next to its destination, and moved when it is complete."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from buildarena_cli.dataset.card import CARD, FILE, Counts, card
from buildarena_cli.dataset.columns import schema
from buildarena_cli.dataset.messages import tools
from buildarena_cli.dataset.reading import Fetched
from buildarena_cli.dataset.rows import row_of
from buildarena_cli.errors import CommandError
from buildarena_cli.site.folder import names_in

GROUP_ROWS: Final = 64
"""Rows of a row group, which is in memory until it is written."""


def write_dataset(fetched: Iterable[Fetched], out: Path, *, licence: str) -> Counts:
    """Write jobs into a new folder, which appears when it is complete.

    Args:
        licence: Licence of the content by models, agents and people.

    Raises:
        CommandError: No job matches, or the folder can't be written.
    """
    definitions, counts = tools(), Counts()

    def rows() -> Iterator[Mapping[str, Any]]:
        for job in fetched:
            row = row_of(job, tools=definitions, licence=licence)
            counts.add(row)
            yield row

    with new_folder(out) as folder:
        left = rows()
        with pq.ParquetWriter(folder / FILE, schema(), compression="zstd") as writer:
            while group := list(islice(left, GROUP_ROWS)):
                writer.write_table(pa.Table.from_pylist(group, schema=schema()))
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
        names = names_in(out)
    except OSError as error:
        raise CommandError(f"{out} can't be read: {error.strerror}") from error
    if names:
        raise CommandError(f"{out} is not empty ({names}): name a new folder")


@contextlib.contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder, and move it to its destination unless the block fails."""
    out = out.resolve()
    check_place(out)
    partial = None
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(mkdtemp(prefix=f".{out.name}.", suffix=".partial", dir=out.parent))
        yield partial
        # What mkdtemp makes is for its owner alone.
        partial.chmod(0o755)
        partial.replace(out)
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror or error}") from error
    finally:
        if partial is not None:
            shutil.rmtree(partial, ignore_errors=True)
