"""A dataset of machines, made from a seed: the same one in any number of processes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from buildarena_cli.dataset.card import CARD
from buildarena_cli.dataset.columns import MACHINES
from buildarena_cli.dataset.machines.card import Counts, card
from buildarena_cli.dataset.machines.crew import Crew
from buildarena_cli.dataset.machines.drawing import DRAWING_VERSION, cycle_of, require_designs
from buildarena_cli.dataset.machines.journal import Journal
from buildarena_cli.dataset.machines.repeating import repeated
from buildarena_cli.dataset.machines.trying import SPLITS, Order, Row, versions_here, working
from buildarena_cli.dataset.writing import Table, check_place, new_folder
from buildarena_cli.errors import CommandError

MAX_ATTEMPTS: Final = 100
"""Draws for one place; only where nearly all machines of a task are there is more than a few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a dataset follows from.

    Attributes:
        seed: Draws everything.
        tasks: The tasks.
        simulator: Name of the engine.
    """

    seed: int
    tasks: tuple[str, ...]
    simulator: str

    def as_document(self) -> dict[str, Any]:
        """JSON values, with the versions of what draws and tries machines here."""
        return {
            "seed": self.seed,
            "tasks": list(self.tasks),
            "drawing_version": DRAWING_VERSION,
            **versions_here(self.simulator),
        }

    def orders(self, first: int, count: int) -> Iterator[Order]:
        """The machines from a place on."""
        cycle = cycle_of(self.tasks)
        for number in range(first, count):
            task = cycle[number % len(cycle)]
            yield Order(task=task, simulator=self.simulator, seed=self.seed, number=number)


def make_machines(
    plan: Plan,
    out: Path,
    *,
    count: int,
    processes: int | None = None,
    on_progress: Callable[[float], object] = lambda _: None,
) -> Counts:
    """Makes a dataset in a new folder, or goes on with one that was interrupted.

    Args:
        plan: What it follows from; fewer machines are the first ones of more.
        out: The folder.
        count: How many machines.
        processes: How many processes draw and try machines; as many as cores if left out.
        on_progress: Called with the share that is done.

    Raises:
        CommandError: The folder has something in it, an interrupted dataset is of another plan,
            no further machine can be drawn, or one comes out different when it is made again.
    """
    out = out.resolve()
    check_place(out)
    require_designs()
    path = out.with_name(f".{out.name}.rows.jsonl")
    with Journal(path, plan.as_document()) as journal:
        with Crew(working, processes) as crew:
            for number in _drawn(plan, count, journal, crew):
                on_progress((number + 1) / count)
            _repeat(journal, count, crew)
        counts = _write(journal, count, plan, out)
        journal.remove()
    return counts


def _drawn(plan: Plan, count: int, journal: Journal, crew: Crew) -> Iterator[int]:
    """Draws what is lacking; the numbers of the machines, those in the journal first."""
    seen: set[str] = set()
    for row in journal.rows():
        seen.add(row["parts_sha256"])
        yield row["number"]
    waiting: deque[tuple[Order, Future[Any]]] = deque()
    orders = plan.orders(len(seen), count)
    while True:
        for order in orders:
            waiting.append((order, crew.submit(order)))
            if len(waiting) >= crew.ahead:
                break
        if not waiting:
            return
        order, begun = waiting.popleft()
        row = _new_row(order, begun.result(), seen, crew)
        seen.add(row["parts_sha256"])
        journal.add(row)
        yield order.number


def _new_row(order: Order, row: Row | None, seen: set[str], crew: Crew) -> Row:
    """The first row of an order's attempts whose machine is not there yet."""
    for attempt in range(1, MAX_ATTEMPTS):
        if row is not None and row["parts_sha256"] not in seen:
            return row
        row = crew.submit(replace(order, attempt=attempt)).result()
    raise CommandError(
        f"{order.task}: {MAX_ATTEMPTS} draws for machine {order.number} gave none that is new"
    )


def _first(journal: Journal, count: int) -> Iterator[Row]:
    return (row for row in journal.rows() if row["number"] < count)


def _repeat(journal: Journal, count: int, crew: Crew) -> None:
    """Builds all machines once more, and simulates the share of them that says so."""
    for row, problems in repeated(_first(journal, count), crew, lambda row: bool(row["retried"])):
        if problems:
            raise CommandError(
                f"machine {row['number']} ({row['id']}) comes out different when it is made "
                f"again: {'; '.join(problems)}"
            )


def _write(journal: Journal, count: int, plan: Plan, out: Path) -> Counts:
    counts = Counts(plan=plan.as_document())
    with new_folder(out) as folder:
        with ExitStack() as tables:
            opened: dict[str, Table] = {}
            for row in _first(journal, count):
                split = row["split"]
                if split not in opened:
                    table = Table(folder / f"{split}.parquet", MACHINES)
                    opened[split] = tables.enter_context(table)
                opened[split].add(row)
                counts.add(row)
        present = [split for split in SPLITS if split in opened]
        (folder / CARD).write_text(card(counts, present), encoding="utf-8")
    return counts
