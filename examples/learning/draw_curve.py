"""Draws the learning curve that learn_bridge.py wrote: `draw_curve.py FOLDER PICTURE`."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from matplotlib.figure import Figure

NAMED = {"mean": "all of a generation", "elite": "its best six", "best": "the best so far"}


def main(folder: Path, picture: Path) -> None:
    """Draws rewards over minutes, the expert's as a line."""
    with (folder / "curve.csv").open(newline="", encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.add_subplot()
    for name, words in NAMED.items():
        axes.plot([row["trials"] for row in rows], [row[name] for row in rows], label=words)
    axes.axhline(1.0, color="gray", linestyle="--", linewidth=1, label="the built-in expert")
    axes.set_xlabel("trials")
    axes.set_ylabel("reward: load / the expert's")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    figure.savefig(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
