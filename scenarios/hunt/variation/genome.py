"""Genomes: action logs that still build something when actions are taken out or mixed in."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Self

from buildarena_geometry import Accepted, Machine, simulated_modules

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
