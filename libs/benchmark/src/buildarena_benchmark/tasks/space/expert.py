"""Machines that fly round a planet: four pairs of nozzles round a starting block."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from typing import Final

from buildarena_benchmark.experts.design import Design, Designs, one_part
from buildarena_benchmark.experts.drafting import EAST, NORTH, SOUTH, UP, WEST, Draft
from buildarena_benchmark.experts.programs import program_text, quoted

_GRAVITY: Final = 32.81
_NOZZLE_PUSH: Final = 0.767
"""Push of a nozzle, in masses that it would hold up."""


def returner(seed: int) -> Design:
    """Return a craft that flies faster than it would orbit, and brakes above where it started."""
    draft = Draft(modules="all")
    middle = draft.start("middle of the craft")
    nozzles = {}
    for name, way in (("north", NORTH), ("east", EAST), ("south", SOUTH), ("west", WEST)):
        nozzles[name] = draft.attach(middle, way, "Steering Thruster")
        draft.turn_axis(nozzles[name], 1, UP)
    return one_part(
        draft,
        "craft",
        "Four Steering Thrusters on the sides of the starting block",
        overall="A starting block with nozzles on each side, which flies by how they differ.",
        program=program_text(
            __package__,
            "orbiting",
            **quoted(nozzles),
            push=f"{4 * _NOZZLE_PUSH * _GRAVITY:g}",
            mass=f"{float(draft.machine.mass):g}",
        )
        + program_text(__package__, "returning", speed=f"{230 + 2 * (seed % 5)}"),
    )


DESIGNS: Final[Designs] = {
    "orbit-2": returner,
}
