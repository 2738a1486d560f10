"""Reference machines of our own design: one function per family, each yielding an action log.

A log is a list of ``{"op": action, "params": arguments}``. Every design is parametric, so that
tests vary it.
"""

from tests.simulation.designs.bridges import (
    beam,
    deck,
    lattice,
    one_shot_bridge,
)
from tests.simulation.designs.draft import (
    BRACE,
    CANNON,
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    TORCH,
    UP,
    WEST,
    WHEEL,
    WINCH,
    WOOD,
    Actions,
    Direction,
    Draft,
    assembled,
    replayed,
)
from tests.simulation.designs.rockets import (
    SIDES,
    paired_engine,
    rocket,
    rocket_assembly,
    waist_engine,
)
from tests.simulation.designs.vehicles import (
    car,
    cart,
    stool,
)

__all__ = [
    "BRACE",
    "CANNON",
    "DOWN",
    "EAST",
    "NORTH",
    "SIDES",
    "SOUTH",
    "TORCH",
    "UP",
    "WEST",
    "WHEEL",
    "WINCH",
    "WOOD",
    "Actions",
    "Direction",
    "Draft",
    "assembled",
    "beam",
    "car",
    "cart",
    "deck",
    "lattice",
    "one_shot_bridge",
    "paired_engine",
    "replayed",
    "rocket",
    "rocket_assembly",
    "stool",
    "waist_engine",
]
