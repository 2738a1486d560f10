"""Answers of a controller without a trial, at the start and to given senses."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.controllers.answers import near_names
from buildarena_simulation.controllers.pilot import Pilot, find_names
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.controllers.senses import TICK_S, Snapshot
from buildarena_simulation.engines.base import CargoPose
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.machine import bindings_of, part_ids, structure_of
from buildarena_simulation.placement import motion_at, start_of
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.sensor_config import Senses
from buildarena_simulation.structure.clusters import find_clusters

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation.structure.model import Structure

MAX_TICKS: Final = 20
MAX_REHEARSAL_S: Final = 0.2
"""Maximum processor time of all ticks of a rehearsal, as other callers wait meanwhile."""
TIME: Final = "t"
"""Name of the time among named senses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answered:
    """A tick of a rehearsal.

    Attributes:
        time_s: Time passed to the program, seconds.
        senses: Senses by name as in a trajectory; only those that its text names.
        actions: Levels by block and action, 0 to 1, as in a trial.
    """

    time_s: float
    senses: Mapping[str, float]
    actions: Mapping[str, float]


def rehearsed(
    text: str,
    machine: "Machine",
    scenario: Scenario,
    ticks: Sequence[Mapping[str, float]] = ({},),
) -> list[Answered]:
    """Run a program at some ticks, one after the other, as a trial would.

    Senses that no tick has named yet are those at the exact start, without noise or delay.

    Args:
        scenario: Its places and senses.
        ticks: Changes by name at each tick, which persist; `TIME` is seconds, and grows by one tick
            unless it is named.

    Raises:
        ControllerFailed: The program failed, or a sense is unknown.
        MachineNotSimulable: The machine has no blocks.
    """
    structure = structure_of(machine)
    exact = Senses(offers=scenario.senses.offers) if scenario.senses else None
    scenario = scenario.model_copy(update={"senses": exact})
    program = Program(text, most_s=MAX_REHEARSAL_S)
    ids, bindings = part_ids(machine), bindings_of(machine)
    pilot = Pilot(structure, bindings, ids, scenario, program.sensors, seed=0)
    program.senses_are(pilot.layout)
    names = {name: place for place, name in enumerate(pilot.sense_names)}
    shown = find_names(text, names)
    values = pilot.senses(_at_start(structure, scenario))
    began, now, answers = time.process_time(), -TICK_S, []
    for tick, changes in enumerate(ticks):
        now = changes.get(TIME, now + TICK_S)
        for name, value in changes.items():
            if name != TIME:
                values[_place(names, name)] = value
        levels = pilot.levels(values, program.answer(tick, now, values))
        answers.append(
            Answered(
                time_s=now,
                senses={name: values[names[name]] for name in shown},
                actions={pilot.channels.names[key]: level for key, level in levels.items()},
            )
        )
        if time.process_time() - began > MAX_REHEARSAL_S:
            raise ControllerFailed(
                f"{tick + 1} ticks took more than {MAX_REHEARSAL_S:g} s of a processor"
            )
    return answers


def _place(names: Mapping[str, int], name: str) -> int:
    place = names.get(name)
    if place is not None:
        return place
    like = near_names(name, names) or list(names)
    raise ControllerFailed(f"there is no sense {name[:60]!r}; there is {', '.join(like) or 'none'}")


def _at_start(structure: "Structure", scenario: Scenario) -> Snapshot:
    """Return the state at the exact start, without any contact of a wheel."""
    start = start_of(structure, scenario, None)
    clusters = find_clusters(structure, np.ones(len(structure.members), dtype=bool))
    motion = motion_at(start, clusters)
    cargo = None
    if start.cargo is not None:
        zero, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        place = start.cargo.position
        cargo = CargoPose(position=place, quaternion=level, velocity=zero, spin=zero)
    return Snapshot(
        time_s=0.0,
        clusters=clusters,
        motion=motion,
        cargo=cargo,
        on_blocks=np.zeros(len(structure)),
        fuel_s=scenario.fuel_s or 0.0,
    )
