"""Machines kept as data: references with a quality, and those that break a rule.

Run as a module (`python -m support.machines.references` in tests/), it writes the goldens of
tests/data/simulation again; see the README there.
"""

import gzip
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, simulate

DATA: Final = Path(__file__).parents[2] / "data" / "simulation"
GOLDENS: Final = DATA / "goldens.json"
RULE_BREAKERS: Final = "rule-breakers"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A reference machine."""

    task: str
    quality: str


def content_of(name: str) -> dict[str, Any]:
    """A stored machine: its task, sub-structures and actions."""
    return dict(_CONTENTS[name])


def load_machine(name: str) -> Machine:
    """A stored machine, whose name begins with `rule-breakers/` where it breaks a rule."""
    content = _CONTENTS[name]
    parts = {key: _replayed(log, {}) for key, log in content.get("sub_structures", {}).items()}
    return _replayed(content["actions"], parts)


@cache
def built_designs() -> dict[str, dict[str, Any]]:
    """Designs of people and machines that once earned points, as documents, by name."""
    return dict(json.loads(gzip.decompress((DATA / "built.json.gz").read_bytes())))


def stored(name: str) -> Machine:
    """One of these machines."""
    return Machine.from_document(built_designs()[name]["machine"])


def outcome(name: str, engine: str) -> dict[str, Any]:
    """What a trial of a reference machine gives: the golden's fields."""
    machine, task = load_machine(name), builtin_tasks()[REFERENCES[name].task]
    trajectory = simulate(machine, task.scenario, engine)
    result = score(task, machine, trajectory)
    first = trajectory.breaks[0] if trajectory.breaks else None
    return {
        "success": result.success,
        "indicator": round(result.indicator, 2),
        "flags": list(result.flags),
        "first_break_s": first.time_s if first else None,
    }


def _replayed(actions: list[dict[str, Any]], parts: Mapping[str, Machine]) -> Machine:
    machine = Machine(available=parts) if parts else Machine()
    for action in actions:
        result = machine.act(action["op"], action["params"])
        if not result.ok:
            raise ValueError(f"{action}: {result.text}")
    return machine


def _stored(kind: str) -> dict[str, dict[str, Any]]:
    return dict(json.loads((DATA / f"{kind}.json").read_text(encoding="utf-8")))


_MACHINES: Final = _stored("machines")
_CONTENTS: Final = _MACHINES | {
    f"{RULE_BREAKERS}/{name}": content for name, content in _stored(RULE_BREAKERS).items()
}
REFERENCES: Final[Mapping[str, Reference]] = MappingProxyType(
    {
        name: Reference(task=content["task"], quality=content["quality"])
        for name, content in sorted(_MACHINES.items())
    }
)


def _write() -> None:
    goldens = {}
    for name in REFERENCES:
        goldens[name] = {engine: outcome(name, engine) for engine in ENGINES}
        sys.stderr.write(f"{name}: {goldens[name]}\n")
    GOLDENS.write_text(json.dumps(goldens, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    _write()
