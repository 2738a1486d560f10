"""The gallery: a folder with the archives, the confirmed machines and an index of them."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from scenarios.hunt.confirming import Confirmed
from scenarios.hunt.trial import Finding, worth
from scenarios.hunt.variation.genome import KINDS, Genome, kind_of

from buildarena_benchmark import builtin_tasks
from buildarena_simulation import SIMULATION_VERSION

BEST: Final = 10
"""Machines of a kind in the index."""

_HEAD: Final = "| machine | task | parts | MuJoCo | PyBullet | seeds | flags | checks |\n|" + (
    "---|" * 8
)


@dataclass(frozen=True, slots=True)
class Gallery:
    """A gallery's folder."""

    folder: Path

    def elites(self, task: str) -> list[Genome]:
        """The genomes of an earlier search; they are tried anew, as rules may have changed."""
        path = self._archive(task)
        if not path.is_file():
            return []
        found = json.loads(path.read_text(encoding="utf-8"))["elites"]
        return [Genome.from_json(elite["genome"]) for elite in found]

    def write_elites(self, task: str, elites: Sequence[Finding], *, trials: int) -> None:
        """Keeps the best of every kind."""
        content = {"task": task, "trials": trials, "elites": [e.as_json() for e in elites]}
        path = self._archive(task)
        path.parent.mkdir(parents=True, exist_ok=True)
        spare = path.with_suffix(".new")
        spare.write_text(json.dumps(content) + "\n", encoding="utf-8")
        spare.replace(path)

    def picture(self, task: str, key: str) -> Path:
        """Where a machine's picture is."""
        folder = self.folder / "machines"
        folder.mkdir(parents=True, exist_ok=True)
        return folder / f"{task}-{key}.png"

    def write_confirmed(self, found: Confirmed) -> None:
        """Keeps a confirmed machine: its scores with its actions, and its document."""
        path = self.picture(found.task, found.genome.key).with_suffix(".json")
        content = {
            "task": found.task,
            "versions": [builtin_tasks()[found.task].version, SIMULATION_VERSION],
            "scores": found.scores,
            "parts": found.parts,
            "robust_share": found.robust_share,
            "suspicions": found.suspicions,
            **found.genome.as_json(),
        }
        path.with_name(f"{path.stem}.machine.json").write_text(
            json.dumps(found.document) + "\n", encoding="utf-8"
        )
        path.write_text(json.dumps(content) + "\n", encoding="utf-8")

    def write_index(self, confirmed: Iterable[Confirmed]) -> Path:
        """Writes the index: first what is suspicious, then the best of each kind."""
        good = [found for found in confirmed if found.success]
        lines = ["# What the hunt found", "", "## Suspects", ""]
        lines += _table(ranked([f for f in good if f.suspicions])) or ["None.", ""]
        for kind in KINDS:
            best = best_of(good, kind)
            lines += [f"## Best of {kind}", "", *(_table(best) or ["None.", ""])]
            lines += [
                f"![{f.task} {f.genome.key}](machines/{f.task}-{f.genome.key}.png)\n" for f in best
            ]
        path = self.folder / "index.md"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def _archive(self, task: str) -> Path:
        return self.folder / "archives" / f"{task}.json"


def best_of(confirmed: Iterable[Confirmed], kind: str) -> list[Confirmed]:
    """The best successes of a kind of task, each beside the expert."""
    return ranked([f for f in confirmed if kind_of(f.task) == kind])[:BEST]


def ranked(confirmed: Iterable[Confirmed]) -> list[Confirmed]:
    """Best first; among equals, that of fewer parts."""

    def place(found: Confirmed) -> tuple[float, int, str]:
        return -round(worth(found.task, found.indicator), 3), found.parts, found.genome.key

    return sorted(confirmed, key=place)


def line_of(found: Confirmed) -> str:
    """A machine as a row of a table."""
    name = f"{found.task}-{found.genome.key}"
    figures = [_figure(found.scores[engine]) for engine in ("mujoco", "pybullet")]
    flags = sorted({flag for told in found.scores.values() for flag in told["flags"]})
    return (
        f"| [{name}](machines/{name}.machine.json) | {found.task} | {found.parts} | "
        f"{figures[0]} | {figures[1]} | {found.robust_share:.0%} | {', '.join(flags)} | "
        f"{', '.join(found.suspicions)} |"
    )


def _table(rows: Sequence[Confirmed]) -> list[str]:
    return [_HEAD, *map(line_of, rows), ""] if rows else []


def _figure(told: Mapping[str, Any]) -> str:
    return f"{told['indicator']:.1f}" if told["success"] else "fails"
