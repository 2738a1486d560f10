"""Trials that blew up, and trials at rest."""

import numpy as np

from buildarena_benchmark.scoring.measures.energy import gains_energy
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, is_lasting, lifted, release_speed
from buildarena_benchmark.scoring.scorer import Deciding
from buildarena_simulation import Scenario
from buildarena_simulation.constants import GRAVITY
from buildarena_simulation.recording import Moment
from buildarena_simulation.scenario import TerrainBox

_MARGIN = 1.5
_SLACK = 15.0
"""Speed any solver's correction may add for a moment, units/s."""

_REST_S = 1.0
_REST_WITHIN = 0.02
"""Distance that parts at rest do not leave for `_REST_S`, units along each axis."""


class AtRest:
    """Decision of trials that keys drive: no key is held or left, and nothing has moved for long.

    Trials with wind or pushes are never decided so, nor before the cargo has its final mass.
    """

    def __init__(self, scenario: Scenario) -> None:
        cargo = scenario.cargo
        self._from_s = 0.0 if cargo is None else cargo.ramp_start_s + cargo.ramp_s
        if scenario.gusts is not None or scenario.pushes:
            self._from_s = np.inf
        self._since_s, self._places = 0.0, np.full((1, 3), np.inf)

    def __call__(self, moment: Moment) -> bool:
        """Return whether the trial is decided at a moment, the next after the last one's."""
        if moment.is_steered or moment.time_s < self._from_s:
            return False
        places = moment.positions()
        if moment.cargo is not None:
            places = np.vstack([places, moment.cargo])
        moved = np.abs(places - self._places).max(initial=0.0)
        if not moved <= _REST_WITHIN:
            self._since_s, self._places = moment.time_s, places
        return moment.time_s - self._since_s >= _REST_S


def is_unstable(run: Run, deciding: Deciding | None = None) -> bool:
    """Return whether what decides the trial moves as no thrust, fall or wheel can explain.

    Either something of it is not finite, or its energy exceeds, over several samples in a row,
    what it could have become: what lies highest at the start falling all the way, all its cannons
    pushing all the time, all at the speed of a wheel's rim at the machine's full size; with a
    margin. Blocks are taken together by mass, the cargo for itself. Where nothing drives the
    machine, it may have no more energy than it began with; see `gains_energy`.

    Args:
        deciding: Bodies and interval that decide; None for all, to the end.
    """
    samples = len(run.time_s) if deciding is None else deciding.samples
    positions = run.positions[:samples]
    members = (
        np.ones(positions.shape[:2], dtype=bool) if deciding is None else deciding.members[:samples]
    )
    cargo = run.trajectory.cargo_position if deciding is None or deciding.cargo else None
    judged: list[np.ndarray] = [
        positions[members],
        run.trajectory.quaternions[:samples][members],
    ]
    if cargo is not None:
        judged.append(cargo[:samples].astype(np.float64))
    if not all(np.isfinite(values).all() for values in judged):
        return True
    if samples < 2 or not positions.shape[1]:  # noqa: PLR2004 - no step, no speed
        return False
    masses = run.block_masses
    bound = _bound(run, masses * members)
    steps = np.diff(run.time_s[:samples])
    weights = (masses * members)[1:] * members[:-1]
    inside = np.where(members[:, :, None], positions, 0.0)
    energies = [_energies(run.scenario, inside, steps, weights)]
    if cargo is not None:
        path = cargo[:samples].astype(np.float64)[:, None]
        energies.append(_energies(run.scenario, path, steps, np.ones((samples - 1, 1))))
    return any(is_lasting(energy > bound) for energy in energies) or gains_energy(run, samples)


def _energies(scenario: "Scenario", positions: Series, steps: Series, weights: Series) -> Series:
    """Return mean energy per mass in each step, (T - 1,), units²/s²; of K points as (T - 1, K)."""
    speed = np.diff(positions, axis=0) / steps[:, None, None]
    each = 0.5 * (speed**2).sum(axis=2) + lifted(scenario, positions[1:])
    return np.asarray((each * weights).sum(axis=1) / np.maximum(weights.sum(axis=1), 1e-9))


def _bound(run: Run, weights: Series) -> Series:
    """Return the greatest plausible energy per mass in each step, (T - 1,), units²/s².

    Args:
        weights: (T, N) the masses of the blocks that decide, 0 for the others.
    """
    start = run.positions[0]
    tops = [_top(box) for box in run.scenario.terrain]
    height = max([0.0, float(start[:, 2].max()), *tops])
    if run.trajectory.cargo_position is not None:
        height = max(height, float(run.trajectory.cargo_position[0, 2]))
    fall = np.sqrt(2.0 * run.scenario.gravity * height) + release_speed(run.scenario)
    modules = [run.machine.blocks[block].module for block in run.trajectory.block_ids]
    thrusts = np.array(
        [
            (module.thrust.heated if module.thrust else 0.0) + module.greatest_push
            for module in modules
        ]
    )
    push = (
        GRAVITY
        * max(run.scenario.drive_strength, 1.0)
        * (((weights > 0.0) @ thrusts) / np.maximum(weights.sum(axis=1), 1e-9))
    )
    gained = np.concatenate([[0.0], np.cumsum(push[1:] * np.diff(run.time_s[: len(push)]))])
    spin = max((module.motor.speed for module in modules if module.motor), default=0.0)
    extent = start.max(axis=0) - start.min(axis=0)
    rim = spin * (float(np.linalg.norm(extent)) + 2.0)
    return np.asarray(0.5 * (_MARGIN * (fall + gained[1:] + rim) + _SLACK) ** 2)


def _top(box: "TerrainBox") -> float:
    """Return the height that no corner of a terrain box exceeds, units."""
    tilt = np.sin(np.radians(abs(box.slope_deg)))
    return float(box.center[2] + (box.size[2] + tilt * (box.size[0] + box.size[1])) / 2)
