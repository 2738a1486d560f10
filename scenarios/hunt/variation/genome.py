"""Genomes: action logs that still build something when actions are taken out or mixed in."""

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final, Self

import numpy as np

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import Accepted, Machine, simulated_modules

IDLE: Final = "function control() return {} end"
_NUMBER: Final = re.compile(r"(?<![\w.\"])\d+(?:\.\d+)?(?![\w.\"])")
_FACTORS: Final = (0.0, 0.5, 0.9, 1.1, 2.0, 10.0)
_SWAPS: Final = (("<", ">"), (">", "<"), ("+", "-"), ("-", "+"), ("min", "max"), ("max", "min"))
_SHARES: Final = (-1.0, -0.5, 0.25, 0.5, 0.75, 1.0)


def changed(program: str, machine: Machine, draw: np.random.Generator) -> str:
    """A program with one random change; it may be none that can be read any more.

    Args:
        program: Lua; "" for none.
        machine: The machine, whose actions a new program asks for.
        draw: What everything is drawn from.
    """
    kind = draw.random()
    if not program or kind < 0.2:
        return _written(machine, draw)
    if kind < 0.7:
        return _renumbered(program, draw)
    if kind < 0.85:
        return _swapped(program, draw)
    lines = program.splitlines()
    at = int(draw.integers(len(lines)))
    return "\n".join([*lines[:at], *lines[at + 1 :]])


def _renumbered(program: str, draw: np.random.Generator) -> str:
    found = list(_NUMBER.finditer(program))
    if not found:
        return program
    number = found[int(draw.integers(len(found)))]
    value = float(number[0]) * float(draw.choice(_FACTORS))
    return f"{program[: number.start()]}{value:.6g}{program[number.end() :]}"


def _swapped(program: str, draw: np.random.Generator) -> str:
    word, other = _SWAPS[int(draw.integers(len(_SWAPS)))]
    places = [match.start() for match in re.finditer(re.escape(word), program)]
    if not places:
        return program
    at = places[int(draw.integers(len(places)))]
    return program[:at] + other + program[at + len(word) :]


def _written(machine: Machine, draw: np.random.Generator) -> str:
    """Some actions all the time, or from one instant to another, whatever is sensed."""
    actions = sorted({a for block in machine.blocks.values() for a in block.module.actions})
    if not actions:
        return IDLE
    chosen = [str(draw.choice(actions)) for _ in range(int(draw.integers(1, 4)))]
    asked = ", ".join(f"{action} = {draw.choice(_SHARES)}" for action in dict.fromkeys(chosen))
    start, length = draw.uniform(0.0, 10.0), draw.uniform(0.2, 20.0)
    when = "true" if draw.random() < 0.5 else f"t > {start:.2f} and t < {start + length:.2f}"
    return f"function control(t)\n  if {when} then return {{ {asked} }} end\n  return {{}}\nend"


KINDS: Final = (
    *("support", "transport", "lift", "mechanisms", "flight", "control"),
    *("throwing", "driving", "delivering"),
)

_FAMILIES: Final = {
    "budget": "support",
    "repair": "transport",
    "identify": "flight",
    "throw": "throwing",
    "deliver": "delivering",
    "drive": "driving",
    "fetch": "mechanisms",
}
"""What sort of machine a family asks for, where its name does not say so."""


ALIKE: Final[Mapping[str, str]] = MappingProxyType(
    {"driving": "transport", "delivering": "transport"}
)
"""Another kind whose machines are worth a try, too."""


def kind_of(task: str) -> str:
    """The kind of a task: control where programs sense; otherwise by its name or its family."""
    if builtin_tasks()[task].scenario.senses is not None:
        return "control"
    kind = task.rpartition("-")[0]
    return _FAMILIES.get(kind, kind)


Action = dict[str, Any]
Actions = list[Action]

MAX_ACTIONS: Final = 240
"""A genome is cut off after so many accepted actions, so that no trial gets long."""

_REFERENCES: Final = ("base_block", "block_a", "block_b", "block_id")


@dataclass(frozen=True, slots=True, kw_only=True)
class Genome:
    """What builds a machine: an action log, and those of the sub-structures it assembles.

    Attributes:
        actions: The machine's log. An action that makes a block or connector may say under `makes`
            what later actions call it.
        sub_structures: Logs by name; empty unless the machine is an assembly.
        program: What controls it, Lua; "" for none.
    """

    actions: Actions
    sub_structures: Mapping[str, Actions] = field(default_factory=dict)
    program: str = ""

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """A genome from the JSON values of an action log's file."""
        return cls(
            actions=list(content["actions"]),
            sub_structures=dict(content.get("sub_structures", {})),
            program=str(content.get("program", "")),
        )

    def as_json(self) -> dict[str, Any]:
        """JSON values that `from_json` reads, and that replay without any genome's help."""
        controlled = {"program": self.program} if self.program else {}
        return controlled | {
            "sub_structures": {name: _plain(log) for name, log in self.sub_structures.items()},
            "actions": _plain(self.actions),
        }

    @property
    def key(self) -> str:
        """A short hash of what it builds."""
        text = json.dumps(self.as_json(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:10]


def grown(genome: Genome, *, most: int = MAX_ACTIONS) -> tuple[Machine, Genome]:
    """The machine a genome builds, and the genome without the actions that were refused.

    Args:
        genome: What to build.
        most: How many accepted actions to stop after, in each log.
    """
    built, logs = {}, {}
    for name, log in genome.sub_structures.items():
        machine, kept = replayed(log, most=most)
        if machine.started:
            built[name], logs[name] = machine, kept
    machine, kept = replayed(genome.actions, built, most=most)
    if genome.program:
        machine = machine.with_controller(genome.program)
    return machine, Genome(actions=kept, sub_structures=logs, program=genome.program)


def replayed(
    actions: Iterable[Action],
    available: Mapping[str, Machine] | None = None,
    *,
    most: int = MAX_ACTIONS,
) -> tuple[Machine, Actions]:
    """Does the actions that can be done and skips the others.

    Args:
        actions: A log; what it refers to may have got another id since.
        available: The machines an assembly may be made of.
        most: How many accepted actions to stop after.

    Returns:
        The machine and the accepted actions, with the ids they have now.
    """
    machine = Machine(available=available, catalogue=simulated_modules())
    kept: Actions = []
    names: dict[str, str] = {}
    for action in actions:
        if len(kept) == most:
            break
        params = {
            key: names.get(value, value) if key in _REFERENCES else value
            for key, value in action["params"].items()
        }
        done = act(machine, action["op"], params)
        if done is None:
            continue
        kept.append(done)
        if "makes" in action and "makes" in done:
            names[action["makes"]] = done["makes"]
    return machine, kept


def act(machine: Machine, op: str, params: Mapping[str, Any]) -> Action | None:
    """Does one action; as a genome's action, or None if it was refused."""
    before = machine.blocks.keys() | machine.connectors.keys()
    if not isinstance(machine.act(op, dict(params)), Accepted):
        return None
    done: Action = {"op": op, "params": dict(params)}
    made = [key for key in (*machine.blocks, *machine.connectors) if key not in before]
    if len(made) == 1:
        done["makes"] = made[0]
    return done


def _plain(actions: Actions) -> Actions:
    return [{"op": action["op"], "params": action["params"]} for action in actions]
