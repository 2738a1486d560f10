"""Rows made again and compared, as `buildarena dataset verify` does."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from buildarena_benchmark import builtin_tasks
from buildarena_cli.dataset.columns import MACHINES, schema
from buildarena_cli.dataset.machines.crew import Crew
from buildarena_cli.dataset.machines.drawing import Calls
from buildarena_cli.dataset.machines.trying import Repetition, Row, versions_here
from buildarena_cli.errors import CommandError
from buildarena_simulation import ENGINES

LONGEST: Final = 60
"""Characters of a value in a message."""
Checked = tuple[Row, list[str]]
"""A row, and what is wrong with it."""


def repeated(rows: Iterable[Row], crew: Crew, simulate: Callable[[Row], bool]) -> Iterator[Checked]:
    """Makes rows again from their actions, in their order.

    Args:
        rows: What the dataset has.
        crew: Processes that do `working`.
        simulate: Which of them are simulated; of the others the machine is compared.
    """
    waiting: deque[tuple[Row, Future[Any] | list[str]]] = deque()
    for row in rows:
        waiting.append((row, _begun(row, crew, simulate=simulate(row))))
        if len(waiting) >= crew.ahead:
            yield _checked(*waiting.popleft())
    while waiting:
        yield _checked(*waiting.popleft())


def _begun(row: Row, crew: Crew, *, simulate: bool) -> Future[Any] | list[str]:
    task = builtin_tasks().get(row["task"])
    if task is None:
        return [f"there is no task {row['task']!r}"]
    if task.version != row["task_version"]:
        return [f"{task.name} is {row['task_version']} there, and {task.version} here"]
    calls = _calls(row["actions"])
    if calls is None:
        return ["actions are no list of calls"]
    if simulate:
        if row["simulator"] not in ENGINES:
            return [f"there is no engine {row['simulator']!r}"]
        here = versions_here(row["simulator"])
        others = [
            f"{name} is {row[name]}, here {here[name]}" for name in here if row[name] != here[name]
        ]
        if others:
            return others
    return crew.submit(Repetition(row=row, calls=calls, simulate=simulate))


def _calls(text: str) -> Calls | None:
    try:
        calls = json.loads(text)
    except (TypeError, ValueError):
        return None
    if not isinstance(calls, list):
        return None
    for call in calls:
        if not isinstance(call, dict) or call.keys() != {"machine", "tool", "arguments"}:
            return None
        if not isinstance(call["machine"], str) or not isinstance(call["arguments"], dict):
            return None
    return calls


def _checked(row: Row, begun: Future[Any] | list[str]) -> Checked:
    if isinstance(begun, list):
        return row, begun
    made = begun.result()
    if made is None:
        return row, ["the process that tried it ended"]
    if isinstance(made, str):
        return row, [made]
    return row, [
        f"{name} is {_short(row[name])}, made again {_short(value)}"
        for name, value in made.items()
        if row[name] != value
    ]


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def stored_rows(folder: Path) -> Iterator[tuple[str, Row]]:
    """The rows of a dataset of machines, each after its file's name.

    Raises:
        CommandError: There is none in the folder, or a file is something else.
    """
    files = sorted(folder.glob("*.parquet"))
    if not files:
        raise CommandError(f"{folder} has no dataset of machines: there is no .parquet file")
    for file in files:
        try:
            table = pq.ParquetFile(file)
            if not table.schema_arrow.equals(schema(MACHINES)):
                raise CommandError(f"{file} has other columns than a dataset of machines")
            for batch in table.iter_batches(batch_size=256):
                for row in batch.to_pylist():
                    yield file.name, row
        except (pa.ArrowException, OSError) as error:
            raise CommandError(f"{file} can't be read: {error}") from error


def verified(folder: Path, crew: Crew) -> Iterator[tuple[str, list[str]]]:
    """Makes every row of a dataset again, trials included: each row's name, and what is wrong."""
    files: deque[str] = deque()

    def rows() -> Iterator[Row]:
        for file, row in stored_rows(folder):
            files.append(file)
            yield row

    seen: set[str] = set()
    for row, problems in repeated(rows(), crew, lambda _: True):
        file = files.popleft()
        if file != f"{row['split']}.parquet":
            problems.append(f"its split is {row['split']}")
        if row["parts_sha256"] in seen:
            problems.append("another row has the same machine")
        seen.add(row["parts_sha256"])
        yield f"{file}, number {row['number']}, {row['id']}", problems
