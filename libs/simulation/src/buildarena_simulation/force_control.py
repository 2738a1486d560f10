"""Commands to blocks that push, hold a height, contract, grab or release."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from buildarena_geometry.modules.forces import Spring
from buildarena_simulation.control import Levels
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.force_field import Commands
from buildarena_simulation.structure.grips import Grips
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces

_ON = 0.5
"""Level above which an action without fractions is on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSchedule:
    """Commands of some steps, one row each.

    Attributes:
        pushing: (S, P) command to each block that pushes, -1 to 1.
        heights: (S, A) change of each held height, units.
        open: (S, B) true for open brakes.
        turning: (S, F) command to each flywheel to turn its block, -1 to 1.
        let_go: (S, D) true from the press of each decoupler's key on.
        rests: (S, K) length of each spring at rest, as a share of its built length.
        grab: (S, G) true for grips commanded to grab.
        release: (S, G) true for grips commanded to release.
    """

    pushing: FloatArray
    heights: FloatArray
    open: FloatArray
    turning: FloatArray
    let_go: BoolArray
    rests: FloatArray
    grab: BoolArray
    release: BoolArray

    def at(self, step: int, kicks: FloatArray) -> Commands:
        """Return the commands of a step.

        Args:
            kicks: (D,) see `Commands`.
        """
        return Commands(
            pushing=self.pushing[step],
            heights=self.heights[step],
            open=self.open[step],
            turning=self.turning[step],
            kicks=kicks,
            rests=self.rests[step],
        )


@dataclass(slots=True)
class ForceState:
    """State of blocks that exert forces.

    Attributes:
        moved: (A,) number of steps by which each held height has risen.
        opened: (B,) true for each brake that has opened for good.
        let_go: (D,) true for each decoupler that was triggered.
        rests: (K,) length of each spring at rest, as a share of its built length.
    """

    moved: FloatArray
    opened: BoolArray
    let_go: BoolArray
    rests: FloatArray

    @classmethod
    def still(cls, structure: Structure, forces: OwnForces) -> Self:
        """Create the state before any command."""
        return cls(
            moved=np.zeros(len(forces.altitudes)),
            opened=np.zeros(len(forces.brakes), dtype=bool),
            let_go=np.zeros(len(forces.decouplers), dtype=bool),
            rests=np.ones(len(structure.ropes.spring_of)),
        )


def plan_forces(
    structure: Structure,
    forces: OwnForces,
    levels: Levels,
    state: ForceState,
    *,
    grips: Grips,
    control: Control,
    times: FloatArray,
    time_step_s: float,
) -> ForceSchedule:
    """Plan the commands to blocks that exert forces by themselves.

    Where the scenario holds the cannons' keys, it holds the fans' keys too.

    Args:
        levels: Commands from keys or a program; actions without fractions are on above a half.
        state: Present state, which is advanced.
        grips: Blocks that hold.
        times: (S,) beginning of each step, seconds.
        time_step_s: Length of one, seconds.
    """
    pushing = np.zeros((len(times), len(forces.pushes)))
    for k, block in enumerate(forces.pushes):
        push = structure.parts[block].module.push
        if push is not None:
            pushing[:, k] = levels(int(block), push.action)
            if push.reverse is not None:
                pushing[:, k] -= levels(int(block), push.reverse)
    if control.mode == "constant":
        pushing[times >= control.from_s - 1e-9] = 1.0
    heights = np.zeros((len(times), len(forces.altitudes)))
    for k, (block, of) in enumerate(zip(forces.altitudes, forces.altitude_of, strict=True)):
        moved = levels(int(block), of.rise) - levels(int(block), of.sink)
        steps = state.moved[k] + np.cumsum(moved)
        heights[:, k], state.moved[k] = steps * of.rate * time_step_s, steps[-1]
    turning = np.zeros((len(times), len(forces.flywheels)))
    for k, (block, wheel) in enumerate(zip(forces.flywheels, forces.flywheel_of, strict=True)):
        turning[:, k] = levels(int(block), wheel.left) - levels(int(block), wheel.right)
    let_go = np.zeros((len(times), len(forces.decouplers)), dtype=bool)
    for k, block in enumerate(forces.decouplers):
        decoupling = structure.parts[block].module.decouple
        if decoupling is not None:
            asked = levels(int(block), decoupling.action) > _ON
            let_go[:, k] = np.logical_or.accumulate(asked) | state.let_go[k]
    state.let_go |= let_go[-1]
    grab, release = _grabbing(structure, grips, levels, len(times))
    return ForceSchedule(
        pushing=pushing,
        heights=heights,
        open=_opened(forces, levels, state, len(times)),
        turning=turning,
        let_go=let_go,
        rests=_rests(structure, levels, state, len(times), time_step_s),
        grab=grab,
        release=release,
    )


def _opened(forces: OwnForces, levels: Levels, state: ForceState, step_count: int) -> FloatArray:
    """Return true for each open brake, (S, B)."""
    opened = np.zeros((step_count, len(forces.brakes)))
    for k, (block, brake) in enumerate(zip(forces.brakes, forces.brake_of, strict=True)):
        asked = np.zeros(step_count, dtype=bool)
        for action in brake.actions:
            asked |= levels(int(block), action) > _ON
        if brake.opens == "once":
            asked = np.logical_or.accumulate(asked) | state.opened[k]
            state.opened[k] = asked[-1]
        opened[:, k] = asked if brake.opens == "once" else ~asked
    return opened


def _grabbing(
    structure: Structure, grips: Grips, levels: Levels, step_count: int
) -> tuple[BoolArray, BoolArray]:
    """Return the commands of each grip to grab, and to release, each (S, G)."""
    grab, release = (np.zeros((step_count, len(grips)), dtype=bool) for _ in range(2))
    for g, block in enumerate(grips.blocks):
        grip = structure.parts[block].module.grip
        if grip is not None:
            grab[:, g] = levels(block, grip.grab) > _ON
            release[:, g] = levels(block, grip.release) > _ON
    return grab, release


def _rests(
    structure: Structure, levels: Levels, state: ForceState, step_count: int, time_step_s: float
) -> FloatArray:
    """Return the length of each spring at rest, (S, K), as a share of its built length."""
    rests = np.tile(state.rests, (step_count, 1))
    for k, spring in enumerate(structure.ropes.spring_of):
        if spring.contract is None:
            continue
        held = levels(len(structure) + k, spring.contract) > _ON
        if held.any() or state.rests[k] < 1.0:
            rests[:, k] = _contract(held, spring, time_step_s, float(state.rests[k]))
            state.rests[k] = rests[-1, k]
    return rests


def _contract(held: BoolArray, spring: Spring, time_step_s: float, share: float) -> FloatArray:
    """Return a spring's length at rest as a share of its built length, (S,); it changes evenly."""
    step = spring.rate * time_step_s
    shares = np.ones(len(held))
    for k, contracts in enumerate(held.tolist()):
        shares[k] = share = (
            max(spring.shortest, share - step) if contracts else min(1.0, share + step)
        )
    return shares
