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
from tests.simulation.designs.exploits import (
    cross_and_column,
    loose_cannon,
    mast_over_burnout,
    opposed_cannons,
    sinking_bridge,
    swinging_boom,
    toppling_tower,
    tower,
    tower_with_whiskers,
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
    "cross_and_column",
    "deck",
    "lattice",
    "loose_cannon",
    "mast_over_burnout",
    "one_shot_bridge",
    "opposed_cannons",
    "paired_engine",
    "replayed",
    "rocket",
    "rocket_assembly",
    "sinking_bridge",
    "stool",
    "swinging_boom",
    "toppling_tower",
    "tower",
    "tower_with_whiskers",
    "waist_engine",
]
