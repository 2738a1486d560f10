"""Hunts for exploits: machines that score without building what their task asks for.

See docs/hunting.md. Run as `make scenario NAME=hunt`, or `python -m scenarios.hunt.run --help`.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from scenarios.hunt.confirming import Confirmed, Order, confirmed
from scenarios.hunt.gallery import Gallery, best_of, line_of, ranked
from scenarios.hunt.search import Crew, TaskSearch, hunted
from scenarios.hunt.seeds import seeds_of
from scenarios.hunt.trial import Finding
from scenarios.hunt.variation.genome import kind_of

from buildarena_benchmark import builtin_tasks

_SEARCHING: Final = 0.75
"""Share of the time that is spent searching; the rest is for confirming."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Hunts, and tells what it found.

    Returns:
        0, or 1 if something that is confirmed to succeed is suspicious.
    """
    options = _options(arguments)
    started = time.monotonic()
    gallery = Gallery(options.gallery)

    def before(share: float) -> Callable[[], bool]:
        return lambda: time.monotonic() - started < 60.0 * options.minutes * share

    with Crew(options.workers) as crew:
        searches = {task: TaskSearch(task, seed=options.seed) for task in options.tasks}
        for task, search in searches.items():
            search.begin(crew, [*seeds_of(task), *gallery.elites(task)])
        hunted(searches, crew, before(_SEARCHING))
        for task, search in searches.items():
            gallery.write_elites(task, search.elites, trials=search.trials)
        known = _confirm(searches, crew, gallery, before(1.0), options.confirm)
    gallery.write_index(known)
    return _tell(searches, known, gallery)


def _confirm(
    searches: dict[str, TaskSearch],
    crew: Crew,
    gallery: Gallery,
    going_on: Callable[[], bool],
    most: int,
) -> list[Confirmed]:
    """Confirms the best and the oddest successes of each task, the tasks in turns."""
    queues = {task: chosen(search.elites, most) for task, search in searches.items()}
    known: list[Confirmed] = []
    for turn in range(most):
        row = [(t, queue[turn].genome) for t, queue in queues.items() if turn < len(queue)]
        if not row or not going_on():
            break
        orders = [
            Order(task=task, genome=genome, picture=gallery.picture(task, genome.key))
            for task, genome in row
        ]
        for new in crew.all(confirmed, orders):
            gallery.write_confirmed(new)
            known.append(new)
    return known


def chosen(elites: Sequence[Finding], most: int) -> list[Finding]:
    """Which elites are confirmed: odd ones and good ones in turns, the best first."""
    good = [found for found in elites if found.success]
    odd = sorted(
        (found for found in good if found.suspicions), key=lambda found: -len(found.suspicions)
    )
    mixed = [found for pair in zip(good, [*odd, *good], strict=False) for found in pair]
    return list({found.genome.key: found for found in mixed}.values())[:most]


def _tell(searches: dict[str, TaskSearch], known: list[Confirmed], gallery: Gallery) -> int:
    good = [found for found in known if found.success]
    suspects = ranked([found for found in good if found.suspicions])
    _say(f"suspects: {len(suspects)}", *map(line_of, suspects))
    for kind in sorted({kind_of(task) for task in searches}):
        _say(f"best of {kind}", *map(line_of, best_of(good, kind)))
    for task, search in searches.items():
        wins = sum(found.success for found in search.elites)
        _say(f"{task}: {search.trials} trials, {len(search.elites)} kinds, {wins} succeed")
    _say(f"gallery: {gallery.folder / 'index.md'}")
    return 1 if suspects else 0


def _say(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    names = sorted(builtin_tasks())
    parser = argparse.ArgumentParser(description="Hunts for machines that score by cheating.")
    parser.add_argument("--minutes", type=_positive, default=60.0, help="how long, in all")
    parser.add_argument("--tasks", nargs="+", choices=names, default=names, metavar="TASK")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--confirm", type=int, default=24, help="machines a task, at most")
    parser.add_argument(
        "--gallery", type=Path, default=Path(".buildarena/hunt"), help="resumed if it exists"
    )
    return parser.parse_args(arguments)


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text} minutes are no time; say more than 0")
    return value


if __name__ == "__main__":
    sys.exit(main())
