"""Who passes in worlds that a trial's seed draws; run by `make bench-worlds`.

Fifty worlds of each task for programs, on both engines: the expert's program, its answers in the
exact world given again without looking (the best schedule of one world), a program that answers at
random, and one that answers nothing. The bars: the expert in 90 %, the others in less than 10 %,
equal verdicts of the engines in 95 %.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from statistics import mean
from typing import Any, Final

from benchmarks.figures import tell
from support.machines.piloted import Answer, experts_machine, listened, repeated, scored

from buildarena_benchmark import builtin_tasks
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


def in_world(name: str, engine: str, seed: int) -> dict[str, Any]:
    """How the four do in one world."""
    task = builtin_tasks()[name]
    expert = experts_machine(task, seed % SEEDS_OF_DESIGNS)
    own = scored(task, expert, engine, seed)
    answers = answers_of(name, engine, seed % SEEDS_OF_DESIGNS)
    return {
        "expert": own.success,
        "indicator": own.indicator,
        "schedule": repeated(answers, task, expert, engine, seed).success,
        "random": scored(
            task, expert.with_controller(random_program(expert)), engine, seed
        ).success,
        "idle": scored(task, expert.with_controller(IDLE), engine, seed).success,
    }


def main() -> None:
    """Measures, prints and keeps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--worlds", type=int, default=WORLDS)
    parser.add_argument("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK")
    parser.add_argument("--processes", type=int)
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    with ProcessPoolExecutor(options.processes) as pool:
        for name in options.tasks:
            rows = {
                engine: list(pool.map(partial(in_world, name, engine), range(options.worlds)))
                for engine in ENGINES
            }
            verdicts = zip(*([row["expert"] for row in of] for of in rows.values()), strict=True)
            figures[name] = {
                engine: {
                    "indicator": round(mean(row["indicator"] for row in of), 3),
                    **{who: mean(row[who] for row in of) for who in PLAYERS},
                }
                for engine, of in rows.items()
            } | {"equal_verdicts": mean(len(set(each)) == 1 for each in verdicts)}
    tell({"worlds": options.worlds, **figures}, options.json)


if __name__ == "__main__":
    main()
