"""Draws learning curves: `draw_curve.py SOURCE… PICTURE`.

A source is the folder that learn_bridge.py wrote, or the run.json of each seed of grpo/train.py.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

NAMED = {"mean": "all of a generation", "elite": "its best six", "best": "the best so far"}
REWARDED = {
    "support-1": "reward: load / the expert's",
    "balance-1": "reward: seconds balanced / the expert's",
}


def main(sources: Sequence[Path], picture: Path) -> None:
    """Draws rewards over what was tried, the expert's as a line."""
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.add_subplot()
    if sources[0].is_dir():
        draw_generations(axes, sources[0])
    else:
        draw_runs(axes, [json.loads(source.read_text(encoding="utf-8")) for source in sources])
    axes.axhline(1.0, color="gray", linestyle="--", linewidth=1, label="the built-in expert")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    figure.savefig(picture)


def draw_generations(axes: Axes, folder: Path) -> None:
    """The generations of learn_bridge.py."""
    with (folder / "curve.csv").open(newline="", encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    for name, words in NAMED.items():
        axes.plot([row["trials"] for row in rows], [row[name] for row in rows], label=words)
    axes.set_xlabel("trials")
    axes.set_ylabel(REWARDED["support-1"])


def draw_runs(axes: Axes, runs: Sequence[dict[str, Any]]) -> None:
    """Means of updates, of runs that differ in their seeds, and of the policies they began as."""
    for run in runs:
        setting = run["setting"]
        played = setting["groups"] * setting["rollouts"]
        means = [row["mean"] for row in run["updates"]]
        places = [row["number"] * played for row in run["updates"]]
        axes.plot(places, means, label=f"mean of an update, seed {setting['seed']}")
    ignorant = float(np.mean([run["tests"]["before"]["mean"] for run in runs]))
    axes.axhline(ignorant, color="gray", linestyle=":", linewidth=1, label="a random policy")
    axes.set_xlabel("rollouts")
    axes.set_ylabel(REWARDED[runs[0]["setting"]["task"]])


if __name__ == "__main__":
    *given, drawn = map(Path, sys.argv[1:])
    main(given, drawn)
