"""The reference machines: per task good, mediocre and bad ones, and how their files are written.

Run as a module (`python -m tests.simulation.references`), it writes the action logs and the goldens
of tests/data/simulation anew; see the README there.
"""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tests.simulation import designs
from tests.simulation.designs import EAST, SIDES, WEST, Actions, replayed

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, simulate

DATA: Final = Path(__file__).parents[1] / "data" / "simulation"
GOLDENS: Final = DATA / "goldens.json"

Logs = tuple[dict[str, Actions], Actions]
_FROM_3: Final = (("UpArrow", 3.0, 6.0),)
_THERE_AND_BACK: Final = (("UpArrow", 3.0, 3.0), ("DownArrow", 7.0, 3.0))
_NINE: Final = tuple((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A reference machine.

    Attributes:
        task: The task it is for.
        quality: "good", "mediocre" or "bad".
        design: Gives its action log, or its sub-structures' logs and its own.
    """

    task: str
    quality: str
    design: Callable[[], Actions | Logs]

    def logs(self) -> Logs:
        made = self.design()
        return made if isinstance(made, tuple) else ({}, made)


def _table() -> dict[str, Reference]:
    def ref(task: str, quality: str, design: Callable[[], Actions | Logs]) -> Reference:
        return Reference(task=task, quality=quality, design=design)

    d = designs
    carrier = {"deck_half": (2, 2), "drive": _FROM_3}
    return {
        "car": ref("transport-1", "good", d.car),
        "car-long-six-wheels": ref("transport-1", "good", lambda: d.car(9, 2, axles=3)),
        "car-that-turns": ref(
            "transport-1",
            "mediocre",
            lambda: d.car(drive=(("RightArrow", 1.0, 0.25), ("UpArrow", 1.6, 2.0))),
        ),
        "car-without-keys": ref("transport-1", "bad", lambda: d.car(bound=False)),
        "cart-of-two-wheels": ref("transport-1", "bad", d.cart),
        "stool-with-wheels-on-top": ref("transport-1", "bad", d.stool),
        "carrier": ref("transport-2", "good", lambda: d.car(5, 2, **carrier)),
        "carrier-without-rails": ref(
            "transport-2", "mediocre", lambda: d.car(5, 2, rails=False, **carrier)
        ),
        "carrier-that-stays": ref(
            "transport-2", "bad", lambda: d.car(5, 2, deck_half=(2, 2), drive=())
        ),
        "post-without-deck": ref(
            "transport-2", "bad", lambda: d.car(3, 1, deck_half=(0, 0), drive=_FROM_3)
        ),
        "long-carrier": ref(
            "transport-3", "good", lambda: d.car(9, 2, deck_half=(2, 4), drive=_THERE_AND_BACK)
        ),
        "long-carrier-without-rails": ref(
            "transport-3",
            "mediocre",
            lambda: d.car(9, 2, deck_half=(2, 4), rails=False, drive=_THERE_AND_BACK),
        ),
        "short-carrier": ref(
            "transport-3", "mediocre", lambda: d.car(5, 2, rails=False, **carrier)
        ),
        "long-carrier-without-keys": ref(
            "transport-3", "bad", lambda: d.car(9, 2, deck_half=(2, 4), bound=False)
        ),
        "one-shot-bridge": ref("support-1", "bad", d.one_shot_bridge),
        "beam-overlapping-braces": ref("support-1", "good", lambda: d.beam(7, "12")),
        "deck-cross-braced": ref("support-1", "good", lambda: d.deck(5, 7, cross=True)),
        "deck": ref("support-1", "mediocre", lambda: d.deck(5, 7)),
        "beam-braced-top-and-bottom": ref("support-1", "mediocre", lambda: d.beam(7, "tb")),
        "beam-braced-on-top": ref("support-1", "mediocre", lambda: d.beam(7, "t")),
        "beam": ref("support-1", "mediocre", lambda: d.beam(7)),
        "beam-along-the-gap": ref("support-1", "mediocre", lambda: d.beam(7, direction=EAST)),
        "beam-too-short": ref("support-1", "bad", lambda: d.beam(5)),
        "wide-deck-trussed": ref(
            "support-2", "good", lambda: d.deck(3, 13, cross=True, along="12")
        ),
        "wide-deck-on-nine-pillars": ref(
            "support-2",
            "bad",
            lambda: d.deck(3, 13, cross=True, along="12", pillars=5, pillar_at=_NINE),
        ),
        "wide-deck-on-two-pillars": ref(
            "support-2", "bad", lambda: d.deck(3, 13, cross=True, pillars=5)
        ),
        "wide-deck": ref("support-2", "mediocre", lambda: d.deck(3, 13, cross=True)),
        "wide-beam-too-short": ref("support-2", "bad", lambda: d.beam(9, "tb")),
        "long-deck-trussed": ref(
            "support-3", "good", lambda: d.deck(3, 23, cross=True, along="12")
        ),
        "long-deck-on-pillars": ref(
            "support-3",
            "bad",
            lambda: d.deck(
                3, 23, cross=True, along="12", pillars=5, pillar_at=((0, -6), (0, 0), (0, 6))
            ),
        ),
        "long-beam-overlapping-braces": ref("support-3", "mediocre", lambda: d.beam(23, "12")),
        "long-deck-too-short": ref("support-3", "bad", lambda: d.deck(3, 17, cross=True)),
        "engine-four-heated": ref("lift-1", "good", d.rocket),
        "engine-two-share-a-flame": ref("lift-1", "good", d.paired_engine),
        "engine-cold": ref("lift-1", "bad", lambda: d.rocket(heated=False)),
        "engine-flame-at-the-waist": ref("lift-1", "bad", d.waist_engine),
        "rocket-four": ref("lift-2", "good", d.rocket),
        "rocket-two": ref("lift-2", "good", lambda: d.rocket((EAST, WEST))),
        "rocket-loaded": ref("lift-2", "mediocre", lambda: d.rocket(cargo_blocks=8)),
        "rocket-lopsided": ref("lift-2", "bad", lambda: d.rocket(skew=True)),
        "rocket-cold": ref("lift-2", "bad", lambda: d.rocket(heated=False)),
        "assembly-braced": ref("lift-3", "good", d.rocket_assembly),
        "assembly-cold": ref("lift-3", "bad", lambda: d.rocket_assembly(heated=False)),
        "assembly-of-one-side": ref("lift-3", "bad", lambda: d.rocket_assembly(sides=SIDES[:1])),
    }


REFERENCES: Final[Mapping[str, Reference]] = MappingProxyType(_table())


def load_machine(name: str) -> Machine:
    """A reference machine from its file."""
    content = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    available = {key: replayed(log) for key, log in content["sub_structures"].items()}
    return replayed(content["actions"], available)


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


def _write() -> None:
    DATA.mkdir(parents=True, exist_ok=True)
    for name, reference in REFERENCES.items():
        parts, actions = reference.logs()
        content = {
            "task": reference.task,
            "quality": reference.quality,
            "sub_structures": parts,
            "actions": actions,
        }
        text = json.dumps(content, separators=(",", ":"))
        (DATA / f"{name}.json").write_text(text.replace('{"op"', '\n{"op"') + "\n", "utf-8")
    goldens = {}
    for name in REFERENCES:
        goldens[name] = {engine: outcome(name, engine) for engine in ENGINES}
        sys.stderr.write(f"{name}: {goldens[name]}\n")
    GOLDENS.write_text(json.dumps(goldens, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    _write()
