"""What trials in the real game say beside our engines; run by `make bench-game`.

Logs of the game that people published (tests/data/besiege/game_logs), each with what its author
made of it, and our engines' trials of the machines that are known. The game's terrains are 4.5
high and its cargo is a little smaller than tasks say; trials have these sizes here, so that
heights can be compared.
"""

import argparse
from pathlib import Path
from typing import Final

import numpy as np
from benchmarks.figures import tell
from numpy.typing import NDArray
from support.machines.families import beam

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_pipeline.evidence.landings import landing_figures
from buildarena_simulation import ENGINES, Scenario, Trajectory, simulate
from buildarena_simulation.scenario import SpanPlacement, gap_terrain

LOGS: Final = Path(__file__).parents[2] / "tests" / "data" / "besiege" / "game_logs"

BEGINS_S: Final = 0.065
"""When the game lets things fall, by its own clock; ours does at 0."""

TERRAIN: Final = 4.5
CARGO: Final = (2.28, 2.28, 1.45)
FALL_HEIGHT: Final = 4.0
"""Below it the published evaluation calls a cargo lost, units."""

Floats = NDArray[np.float64]


def in_game(scenario: Scenario) -> Scenario:
    """A bridge's scenario with the sizes that the game's logs show."""
    placement, cargo = scenario.placement, scenario.cargo
    assert isinstance(placement, SpanPlacement)
    assert cargo is not None
    return scenario.model_copy(
        update={
            "terrain": gap_terrain(placement.gap, height=TERRAIN),
            "placement": SpanPlacement(gap=placement.gap, lowest_center=TERRAIN + 1.0),
            "cargo": cargo.model_copy(update={"size": CARGO}),
        }
    )


def cargo_path(trajectory: Trajectory, scenario: Scenario) -> tuple[Floats, Floats]:
    """Times by the game's clock, s, and heights of the cargo's underside, units, (T,) each."""
    assert trajectory.cargo_position is not None
    assert scenario.cargo is not None
    height = trajectory.cargo_position[:, 2].astype(np.float64) - scenario.cargo.size[2] / 2
    return trajectory.time_s + BEGINS_S, height


def logged(file: str) -> dict[str, float | None]:
    """The figures of a log: rows of time and height last, or of the published runner."""
    rows = [line.split(",") for line in (LOGS / file).read_text(encoding="ascii").splitlines()[1:]]
    named = [row for row in rows if not row[1].startswith("ID_") or len(row) == 5]
    column = {5: 3, 4: 2, 2: 1}[len(named[0])]
    path = np.array([(float(row[0]), float(row[column])) for row in named])
    return landing_figures(path[:, 0], path[:, 1], lost_below=FALL_HEIGHT)


def simulated(task: str, machine: Machine) -> dict[str, object]:
    """Each engine's verdict of a machine in a task, and figures with the game's sizes."""
    chosen = builtin_tasks()[task]
    scenario = in_game(chosen.scenario)
    found: dict[str, object] = {}
    for engine in ENGINES:
        result = score(chosen, machine, simulate(machine, chosen.scenario, engine))
        path = cargo_path(simulate(machine, scenario, engine), scenario)
        found[engine] = {
            "success": result.success,
            "load": result.metrics["load_when_decided"],
            **landing_figures(*path, lost_below=FALL_HEIGHT),
        }
    return found


TRIALS: Final = {
    "seven blocks": ("support-1", "support-1_seven_blocks.csv", False, 103.0),
    "sagging bridge": ("support-2", "support-2_sagging_bridge_y.csv", True, 553.0),
    "deck of 18 blocks": ("support-2", "support-2_through_y.csv", False, 24.0),
}
"""Public trials: task, log, its author's verdict, and the cargo's mass when it was below 4."""

KNOWN: Final = {"seven blocks": beam(7)}
"""Machines that are public; a straight beam is the natural reading of seven blocks."""


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    figures = {
        name: {
            "task": task,
            "game": {"success": success, "load": load, **logged(file)},
            **(simulated(task, KNOWN[name]) if name in KNOWN else {}),
        }
        for name, (task, file, success, load) in TRIALS.items()
    }
    tell(figures, parser.parse_args().json)


if __name__ == "__main__":
    main()
