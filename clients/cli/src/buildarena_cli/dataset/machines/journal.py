"""The rows of a dataset that is being made: a file beside it, from which it is resumed."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Self

from buildarena_cli.errors import CommandError

_END: Final = b"\n"


class Journal:
    """Rows that are kept as they come, each on a line after the plan's. Use it as a context.

    Args:
        path: The file; what it has of the same plan is kept, but for a line that is not whole.
        plan: What the rows follow from, JSON values.

    Raises:
        CommandError: The file is of another plan or in use, or can't be read or written.
    """

    def __init__(self, path: Path, plan: Mapping[str, Any]) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b")
        except OSError as error:
            raise CommandError(f"{path} can't be written: {error.strerror}") from error
        try:
            self._lock()
            self._begin(dict(plan))
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise CommandError(
                f"another process makes this dataset: it writes {self.path}"
            ) from error

    def _begin(self, plan: dict[str, Any]) -> None:
        self._file.seek(0)
        whole = 0
        for number, line in enumerate(self._file):
            if not line.endswith(_END):
                break
            if number == 0:
                self._require_same(plan, line)
            whole += len(line)
        self._file.truncate(whole)
        if not whole:
            self._write(plan)

    def _require_same(self, plan: dict[str, Any], line: bytes) -> None:
        try:
            stored = json.loads(line)
        except ValueError:
            stored = None
        if not isinstance(stored, dict):
            raise CommandError(f"{self.path} is no journal of a dataset: move it away")
        others = [f"{name} {stored.get(name)}" for name in plan if stored.get(name) != plan[name]]
        if others:
            raise CommandError(
                f"{self.path} has an interrupted dataset with {', '.join(others)}: make it with "
                "these, name another folder, or delete the file"
            )

    def rows(self) -> Iterator[dict[str, Any]]:
        """The rows, in order; none may be added meanwhile."""
        with self.path.open("rb") as file:
            next(file)
            for line in file:
                yield json.loads(line)

    def add(self, row: Mapping[str, Any]) -> None:
        """Keeps a row; it survives the end of this process."""
        self._write(row)

    def _write(self, value: Mapping[str, Any]) -> None:
        try:
            self._file.write(json.dumps(value).encode() + _END)
            self._file.flush()
        except OSError as error:
            raise CommandError(f"{self.path} can't be written: {error.strerror}") from error

    def remove(self) -> None:
        """Deletes the file, once its rows are elsewhere."""
        self.path.unlink()
