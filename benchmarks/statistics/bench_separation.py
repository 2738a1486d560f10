"""Measures on how many tasks a board separates a strong, a middling and a weak model.

All build as the expert does; the weak one forgets some of the steps in every job, the middling one
in every second. Each plays a number of jobs of every task, and is ranked as a service ranks it: on
the board of each category, and on the board of all.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from support.boards.apprentices import APPRENTICES, job_of

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import BoardQuery, TrackBoard

BAR = 12
"""Tasks on which the ranks of all three differ, each on the board of its category."""


def main() -> int:
    """Runs the benchmark.

    Returns:
        The exit code: 1 if ranks differ on fewer tasks than they should.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument("--jobs", type=int, default=16, help="of each model on each task")
    parser.add_argument("--worlds", type=int, default=4, help="varied ones in which jobs score")
    parser.add_argument("--simulator", default="mujoco")
    parser.add_argument("--tasks", nargs="+", default=[*builtin_tasks()])
    options = parser.parse_args()
    tasks = {name: builtin_tasks()[name] for name in options.tasks}
    ranked = TrackBoard({name: task.version for name, task in tasks.items()}, {})
    for number, (name, task) in enumerate(tasks.items()):
        for model in APPRENTICES:
            for seed in range(options.jobs):
                first = (number * options.jobs + seed) * options.worlds
                worlds = range(first, first + options.worlds)
                ranked.put(job_of(task, model, seed, worlds=worlds, engine=options.simulator))
        sys.stdout.write(f"{name}: tried\n")
        sys.stdout.flush()
    # What a board claims of one task hangs on how many tasks it has.
    categories = {task.category for task in tasks.values()}
    scopes = [[n for n, t in tasks.items() if t.category == of] for of in sorted(categories)]
    rows = [row for names in scopes for row in _rows(ranked, names)]
    for row in rows:
        sys.stdout.write(f"{row['task']:14s} {row['ranks']}  {row['success']}\n")
    separated, ends = _separated(rows)
    together, ends_together = _separated(_rows(ranked, list(tasks)))
    sys.stdout.write(
        f"by category all three ranks differ on {separated} of {len(rows)} tasks (bar {BAR}), "
        f"the strong and the weak on {ends}; on one board of all on {together} and "
        f"{ends_together}\n"
    )
    figures: dict[str, Any] = {
        "jobs": options.jobs,
        "worlds": options.worlds,
        "separated": separated,
        "separated_on_one_board": together,
        "rows": rows,
    }
    keep(figures, options.json)
    return int(separated < BAR)


def _separated(rows: Sequence[Mapping[str, Any]]) -> tuple[int, int]:
    """On how many tasks all ranks differ, and on how many the strong one's and the weak one's."""
    return (
        sum(len(set(row["ranks"].values())) == len(APPRENTICES) for row in rows),
        sum(row["ranks"]["strong"] < row["ranks"]["weak"] for row in rows),
    )


def _rows(ranked: TrackBoard, names: Sequence[str]) -> list[dict[str, Any]]:
    """Ranks, shares of successes and mean indicators on some tasks."""
    query = BoardQuery(tasks=frozenset(names), overall=frozenset(names))
    boards = {board.task: board for board in ranked.board(query).tasks}
    found = []
    for name in names:
        rows = {row.cell.model: row for row in boards[name].rows}
        found.append(
            {
                "task": name,
                "ranks": {model: rows[model].rank for model in APPRENTICES},
                "success": {
                    model: round(rows[model].cell.success_rate or 0, 3) for model in APPRENTICES
                },
                "indicator": {model: rows[model].cell.indicator_mean for model in APPRENTICES},
            }
        )
    return found


if __name__ == "__main__":
    raise SystemExit(main())
