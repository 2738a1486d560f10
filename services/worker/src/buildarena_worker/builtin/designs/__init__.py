"""Parametric designs of our own for the built-in tasks; docs/expert.md explains them."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from buildarena_worker.builtin.designs import (
    arms,
    bridges,
    couriers,
    flyers,
    piloted,
    repairs,
    risers,
    rockets,
    rovers,
    spacecraft,
    throwers,
    vehicles,
    walkers,
)
from buildarena_worker.builtin.designs.design import Design

DESIGNS: dict[str, Callable[[int], Design]] = {
    "transport-1": vehicles.car,
    "transport-2": vehicles.carrier,
    "transport-3": vehicles.long_carrier,
    "support-1": lambda seed: bridges.braced_beam(seed, gap=5),
    "support-2": lambda seed: bridges.braced_deck(seed, gap=10),
    "support-3": lambda seed: bridges.braced_beam(seed, gap=20),
    "lift-1": rockets.engine,
    "lift-2": rockets.rocket,
    "lift-3": rockets.framed_rocket,
    "mechanisms-1": rovers.rough_rider,
    "mechanisms-2": rovers.slalom_car,
    "mechanisms-3": arms.geared_lift,
    "mechanisms-4": arms.swinging_arm,
    "flight-1": flyers.hoverer,
    "flight-2": flyers.glider,
    "support-4": lambda seed: bridges.braced_beam(seed, gap=30, overlap=6),
    "support-5": lambda seed: bridges.braced_beam(seed, gap=45, overlap=6),
    "support-6": lambda seed: bridges.braced_beam(seed, gap=5),
    "support-7": lambda seed: bridges.braced_deck(seed, gap=10),
    "mechanisms-5": rovers.long_slalom_car,
    "mechanisms-6": arms.swinging_arm,
    "transport-4": rovers.touring_car,
    "flight-3": flyers.stepping_hoverer,
    "lift-4": rockets.payload_rocket,
    "mechanisms-7": arms.loaded_lift,
    "budget-1": lambda seed: bridges.light_beam(seed, gap=10),
    "repair-1": repairs.repaired_car,
    "identify-1": risers.riser,
    "landing-1": piloted.lander,
    "slalom-2": piloted.gate_finder,
    "hover-3": piloted.keeper,
    "hover-4": piloted.keeper,
    "landing-2": piloted.sparing_lander,
    "balance-1": piloted.balancer,
    "balance-2": piloted.balancer,
    "walk-1": walkers.walker,
    "walk-2": walkers.corner_walker,
    "place-2": piloted.placer,
    "line-1": piloted.line_follower,
    "throw-1": throwers.catapult,
    "throw-2": throwers.catapult,
    "throw-3": throwers.aiming_catapult,
    "throw-4": throwers.ring_shooter,
    "throw-5": throwers.ring_shooter,
    "orbit-1": spacecraft.orbiter,
    "orbit-2": spacecraft.returner,
    "deliver-1": couriers.courier,
    "deliver-2": couriers.courier,
    "deliver-3": couriers.courier,
    "drive-1": vehicles.climber,
    "drive-2": vehicles.climber,
    "drive-3": rovers.cone_passer,
    "drive-4": rovers.track_follower,
    "fetch-1": arms.well_crane,
}
"""By a built-in task's name: the design for a seed, which varies it within its tolerances."""

LEVEL_DESIGNS: dict[str, Callable[[int], Design]] = {
    "besiegefield-car-1": vehicles.climber,
    "besiegefield-car-2": vehicles.climber,
    "besiegefield-car-4": vehicles.climber,
    "besiegefield-delivery-1": couriers.courier,
    "besiegefield-delivery-3": couriers.courier,
    "besiegefield-delivery-5": couriers.courier,
    **{f"besiegefield-catapult-{level}": throwers.fenced_catapult for level in range(1, 8)},
    "besiegefield-catapult-8": partial(throwers.fenced_catapult, last_s=0.16),
    "besiegefield-catapult-9": partial(throwers.fenced_catapult, last_s=0.24),
    "besiegefield-catapult-10": throwers.fenced_catapult,
}
"""Likewise for levels of BesiegeField, which are task files of examples/tasks."""

__all__ = ["DESIGNS", "LEVEL_DESIGNS", "Design"]
