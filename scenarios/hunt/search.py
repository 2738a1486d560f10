"""The search: per task an archive that keeps the best of every kind of machine (MAP-Elites)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Final, Self, TypeVar

import numpy as np
from ribs.archives import GridArchive
from scenarios.hunt.trial import CELLS, RANGES, Finding, Scorer, tried
from scenarios.hunt.variation.genome import Genome, kind_of
from scenarios.hunt.variation.mutation import crossed, mutated
from threadpoolctl import threadpool_limits

from buildarena_benchmark import builtin_tasks, score


@dataclass(frozen=True, slots=True, kw_only=True)
class Child:
    """A genome to make and try, as a worker process gets it."""

    task: str
    parents: tuple[Genome, ...]
    seed: tuple[int, ...]
    scorer: Scorer
    changed: bool = True


def made(child: Child) -> Finding | None:
    """Makes a child and tries it; equal children give equal findings in every process."""
    draw = np.random.default_rng(child.seed)
    genome = child.parents[0]
    if len(child.parents) > 1:
        genome = crossed(genome, child.parents[1], draw)
    if child.changed:
        genome = mutated(genome, kind_of(child.task), draw)
    with threadpool_limits(limits=1):
        return tried(child.task, genome, child.scorer)


Item = TypeVar("Item")
Result = TypeVar("Result")

BATCH: Final = 16
"""Children of a generation."""

_CROSSED_SHARE: Final = 0.15
_GREEDY_SHARE: Final = 0.4
"""How many parents are the better of four; the others are drawn evenly from all cells."""


class Crew:
    """Worker processes; or none, and everything runs here."""

    def __init__(self, workers: int) -> None:
        self._pool = get_context("spawn").Pool(workers) if workers > 1 else None

    def all(self, work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """The results in the order of the items, whoever made them."""
        if self._pool is None:
            return [work(item) for item in items]
        return self._pool.map(work, items, chunksize=1)

    def __enter__(self) -> Self:
        """Nothing to do: the processes run already."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the processes."""
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()


class TaskSearch:
    """The search on one task."""

    def __init__(self, task: str, *, seed: int, scorer: Scorer = score) -> None:
        self.task, self.generation, self.trials = task, 0, 0
        self._seed, self._scorer = seed, scorer
        self._number = list(builtin_tasks()).index(task)  # what is added changes no search before
        self._archive = GridArchive(
            solution_dim=(),
            dims=list(CELLS),
            ranges=list(RANGES),
            solution_dtype=object,
            objective_dtype=np.float64,
            measures_dtype=np.float64,
            seed=seed,
        )

    @property
    def elites(self) -> list[Finding]:
        """The best of every kind, the best of all first."""
        data = self._archive.data()
        order = sorted(
            range(len(data["index"])), key=lambda i: (-data["objective"][i], data["index"][i])
        )
        return [data["solution"][i] for i in order]

    def add(self, findings: Iterable[Finding | None]) -> None:
        """Keeps what is the best of its kind so far."""
        for finding in findings:
            if finding is not None:
                held = np.empty((), dtype=object)
                held[()] = finding
                self._archive.add_single(held, finding.objective, np.array(finding.measures))

    def begin(self, crew: Crew, seeds: Sequence[Genome]) -> None:
        """Tries the genomes that the search starts from.

        Raises:
            ValueError: None of them builds a machine that may be tried.
        """
        children = [
            Child(task=self.task, parents=(g,), seed=(0,), scorer=self._scorer, changed=False)
            for g in seeds
        ]
        self.trials += len(children)
        self.add(crew.all(made, children))
        if not self.elites:
            raise ValueError(f"{self.task}: no seed builds a machine that may be tried")

    def advance(self, crew: Crew, batch: int = BATCH) -> None:
        """One generation."""
        elites = self.elites
        draw = np.random.default_rng((self._seed, self._number, self.generation))
        children = []
        for k in range(batch):
            count = 2 if draw.random() < _CROSSED_SHARE else 1
            children.append(
                Child(
                    task=self.task,
                    parents=tuple(_parent(elites, draw).genome for _ in range(count)),
                    seed=(self._seed, self._number, self.generation, k),
                    scorer=self._scorer,
                )
            )
        self.trials += len(children)
        self.add(crew.all(made, children))
        self.generation += 1


def _parent(elites: Sequence[Finding], draw: np.random.Generator) -> Finding:
    """One of the elites, which come best first."""
    several = 4 if draw.random() < _GREEDY_SHARE else 1
    return elites[int(draw.integers(len(elites), size=several).min())]


def hunted(searches: Mapping[str, TaskSearch], crew: Crew, going_on: Callable[[], bool]) -> None:
    """Takes the tasks in turns, a generation each, for as long as it may go on."""
    while True:
        for search in searches.values():
            if not going_on():
                return
            search.advance(crew)
