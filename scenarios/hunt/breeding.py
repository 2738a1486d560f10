"""Children of genomes: made and tried in worker processes, which need not load the archive."""

from dataclasses import dataclass

import numpy as np
from scenarios.hunt.trial import Finding, Scorer, tried
from scenarios.hunt.variation.genome import Genome
from scenarios.hunt.variation.kinds import kind_of
from scenarios.hunt.variation.mutation import crossed, mutated
from threadpoolctl import threadpool_limits


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
