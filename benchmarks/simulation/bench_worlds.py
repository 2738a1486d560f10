"""Who passes in worlds that a trial's seed draws; run by `make bench-worlds`.

Fifty worlds of each task for programs, on both engines: the expert's program, its answers in the
exact world given again without looking (the best schedule of one world), a program that answers at
random, and one that answers nothing. The bars: the expert in 90 %, the others in less than 10 %,
equal verdicts of the engines in 95 %.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from statistics import mean
from typing import Any, Final, NamedTuple

from benchmarks.figures import tell
from support.machines.piloted import Answer, experts_machine, listened, repeated, scored

from buildarena_benchmark import Score, builtin_tasks
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES
from buildarena_simulation.control import channel
from buildarena_simulation.machine import bindings_of, part_ids

WORLDS: Final = 50
IDLE: Final = "function control() return {} end"
RANDOM: Final = """
local names = {%s}
local answers, since = {}, -1
function control(t)
  if t - since >= 1 then
    since = t
    for _, name in ipairs(names) do answers[name] = 2 * math.random() - 1 end
  end
  return answers
end
"""
TASKS: Final = [name for name, task in builtin_tasks().items() if task.scenario.draws]
SEEDS_OF_DESIGNS: Final = 5
PLAYERS: Final = ("expert", "schedule", "random", "idle")


@cache
def answers_of(name: str, engine: str, seed: int) -> list[Answer]:
    """What the expert's program answers in the exact world."""
    task = builtin_tasks()[name]
    return listened(task, experts_machine(task, seed), engine)[1]


def random_program(machine: Machine) -> str:
    """A program that asks for every action of every block by chance, anew each second."""
    ids, bindings = part_ids(machine), bindings_of(machine)
    bound = zip(ids, bindings, strict=True)
    names = (channel(part, action) for part, actions in bound for action in actions)
    return RANDOM % ", ".join(f'"{name}"' for name in names)


class Result(NamedTuple):
    """Of a score what processes send each other."""

    success: bool
    indicator: float


def in_world(name: str, engine: str, players: Sequence[str], seed: int) -> dict[str, Result]:
    """How players do in one world."""
    task = builtin_tasks()[name]
    machine = experts_machine(task, seed % SEEDS_OF_DESIGNS)
    plays: dict[str, Callable[[], Score]] = {
        "expert": lambda: scored(task, machine, engine, seed),
        "schedule": lambda: repeated(
            answers_of(name, engine, seed % SEEDS_OF_DESIGNS), task, machine, engine, seed
        ),
        "random": lambda: scored(
            task, machine.with_controller(random_program(machine)), engine, seed
        ),
        "idle": lambda: scored(task, machine.with_controller(IDLE), engine, seed),
    }
    scores = {player: plays[player]() for player in players}
    return {player: Result(score.success, score.indicator) for player, score in scores.items()}


def summed(rows: Sequence[Mapping[str, Result]]) -> dict[str, float]:
    """Shares of worlds that each player passes, and the expert's mean indicator."""
    shares = {player: mean(row[player].success for row in rows) for player in rows[0]}
    if "expert" not in shares:
        return shares
    return {"indicator": round(mean(row["expert"].indicator for row in rows), 3), **shares}


def equal_verdicts(rows: Sequence[Sequence[Mapping[str, Result]]]) -> float:
    """In what share of worlds the engines say the same of all players."""
    return mean(
        len({tuple(score.success for score in row.values()) for row in world}) == 1
        for world in zip(*rows, strict=True)
    )


def main() -> None:
    """Measures, prints and keeps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--worlds", type=int, default=WORLDS)
    parser.add_argument("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK")
    parser.add_argument("--players", nargs="+", choices=PLAYERS, default=PLAYERS, metavar="PLAYER")
    parser.add_argument("--processes", type=int)
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    with ProcessPoolExecutor(options.processes) as pool:
        for name in options.tasks:
            rows = {
                engine: list(
                    pool.map(
                        partial(in_world, name, engine, options.players), range(options.worlds)
                    )
                )
                for engine in ENGINES
            }
            figures[name] = {engine: summed(of) for engine, of in rows.items()}
            figures[name]["equal_verdicts"] = equal_verdicts(list(rows.values()))
    tell({"worlds": options.worlds, **figures}, options.json)


if __name__ == "__main__":
    main()
