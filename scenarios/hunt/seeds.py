"""What the search starts from: the reference machines and the past exploits of a kind of task."""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from scenarios.hunt.variation.genome import ALIKE, Genome, grown, kind_of

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment.expert_calls import control_of
from buildarena_benchmark.experts import expert_designs
from buildarena_geometry import Machine

DATA: Final = Path(__file__).parents[2] / "tests" / "data"
EXPLOITS: Final = DATA / "exploits.json"
_REFERENCES: Final = DATA / "simulation" / "machines.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploit:
    """A machine that once earned points without building what is asked for.

    Attributes:
        name: Under which it is stored.
        task: The task it is for.
        once: What it was once worth.
        why: Why that is an exploit.
        seconds: How long a trial must be to show that it is closed.
        most: What it may be worth now, on every engine; 0 for what must fail.
        genome: What builds it.
    """

    name: str
    task: str
    once: str
    why: str
    seconds: float
    most: float
    genome: Genome

    @property
    def machine(self) -> Machine:
        """The machine, with every action that is stored."""
        machine, kept = grown(self.genome, most=sys.maxsize)
        if kept.as_json() != self.genome.as_json():
            raise ValueError(f"{self.name}: not all of its actions are accepted")
        return machine


def exploits(file: Path = EXPLOITS) -> list[Exploit]:
    """The stored exploits."""
    return [_exploit(name, content) for name, content in _contents(file).items()]


def seeds_of(task_name: str) -> list[Genome]:
    """Genomes to start from: all that suit the task's kind and number of sub-structures.

    The expert's machine is among them, and where none of the task's family is stored, those for
    all tasks of its kind that have none either. Some kinds begin with the machines of another, too.
    """
    task = builtin_tasks()[task_name]
    whole = task.constraints.min_sub_structures < 2
    found = [Genome(actions=[{"op": "start", "params": {}, "makes": "1"}])] if whole else []
    if whole and task.initial_machine is None and task_name in expert_designs():
        found.append(expert_genome(task_name))
    stored = list(_stored())
    families = {_family(other) for other, _ in stored}
    if _family(task_name) not in families:
        alike = [name for name in expert_designs() if kind_of(name) == kind_of(task_name)]
        found += [
            expert_genome(name)
            for name in alike
            if _family(name) not in families
            and name != task_name
            and builtin_tasks()[name].initial_machine is None
        ]
    kind = kind_of(task_name)
    for other, genome in stored:
        if kind_of(other) in {kind, ALIKE.get(kind)} and bool(genome.sub_structures) != whole:
            found.append(genome)
    return found


def _family(task_name: str) -> str:
    return task_name.rpartition("-")[0]


def expert_genome(task_name: str) -> Genome:
    """The expert's machine, with its keys or its program."""
    design = expert_designs()[task_name](0)
    log = [*next(iter(design.parts.values())).actions, *control_of(design.control or {})]
    actions = [{"op": op, "params": dict(params)} for op, params in log]
    return grown(Genome(actions=actions, program=design.program), most=sys.maxsize)[1]


def _stored() -> Iterator[tuple[str, Genome]]:
    for content in [*_contents(_REFERENCES).values(), *_contents(EXPLOITS).values()]:
        yield content["task"], Genome.from_json(content)


def _contents(file: Path) -> dict[str, dict[str, Any]]:
    return dict(json.loads(file.read_text(encoding="utf-8")))


def _exploit(name: str, content: dict[str, Any]) -> Exploit:
    missing = {"task", "once", "why", "seconds", "most", "actions"} - content.keys()
    if missing or content.get("task") not in builtin_tasks():
        raise ValueError(
            f"{name}: an exploit has a built-in task, once, why, seconds, most and actions; "
            f"missing or wrong: {', '.join(sorted(missing)) or 'task'}"
        )
    told = {key: content[key] for key in ("task", "once", "why", "seconds", "most")}
    return Exploit(name=name, genome=Genome.from_json(content), **told)
