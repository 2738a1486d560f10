"""How keys control blocks that push, hold a height, contract or let go."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from buildarena_geometry.modules.forces import Spring
from buildarena_simulation.control import Bindings, KeyHold, held_during
from buildarena_simulation.scenario import Control
from buildarena_simulation.structure.force_field import Commands
from buildarena_simulation.structure.grips import grips_of
from buildarena_simulation.structure.model import BoolArray, FloatArray, Structure
from buildarena_simulation.structure.own_forces import OwnForces


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSchedule:
    """Commands of a whole trial, one row per engine step.

    Attributes:
        pushing: (S, P) whether each fan's key is held.
        heights: (S, A) by how much each held height was moved, units.
        let_go: (S, D) whether each decoupler's key was pressed by then.
        rests: (S, K) length of each spring at rest, as a share of its built length.
        grab: (S, G) whether each grip's key for it is held.
        release: (S, G) the same to let go.
    """

    pushing: BoolArray
    heights: FloatArray
    let_go: BoolArray
    rests: FloatArray
    grab: BoolArray
    release: BoolArray

    def at(self, step: int, kicks: FloatArray) -> Commands:
        """What is asked for from a step on.

        Args:
            step: The step.
            kicks: (D,) as in `Commands`.
        """
        return Commands(
            pushing=self.pushing[step],
            heights=self.heights[step],
            kicks=kicks,
            rests=self.rests[step],
        )


def plan_forces(
    structure: Structure,
    forces: OwnForces,
    bindings: Bindings,
    keys: Sequence[KeyHold],
    *,
    control: Control,
    times: FloatArray,
) -> ForceSchedule:
    """The commands a control sequence gives to blocks that exert forces by themselves.

    Where the scenario holds the cannons' keys, it holds the fans' keys too.

    Args:
        structure: The machine.
        forces: What its blocks exert.
        bindings: (N + K,) the keys of each block's actions, then of each spring's.
        keys: The control sequence; read in mode "agent" only.
        control: Who presses the keys.
        times: (S,) when each engine step begins, seconds, evenly spaced from 0.
    """
    pressed = keys if control.mode == "agent" else ()
    time_step_s = float(times[1]) if len(times) > 1 else 0.0
    pushing = np.zeros((len(times), len(forces.pushes)), dtype=bool)
    if control.mode == "held":
        pushing[times >= control.from_s - 1e-9] = True
    for k, block in enumerate(forces.pushes):
        push = structure.parts[block].module.push
        if push is not None:
            pushing[:, k] |= held_during(pressed, bindings[block].get(push.action, ()), times)
    heights = np.zeros((len(times), len(forces.altitudes)))
    for k, (block, of) in enumerate(zip(forces.altitudes, forces.altitude_of, strict=True)):
        bound = bindings[block]
        rises = held_during(pressed, bound.get(of.rise, ()), times).astype(np.float64)
        sinks = held_during(pressed, bound.get(of.sink, ()), times).astype(np.float64)
        heights[:, k] = np.cumsum(rises - sinks) * of.rate * time_step_s
    let_go = np.zeros((len(times), len(forces.decouplers)), dtype=bool)
    for k, block in enumerate(forces.decouplers):
        decoupling = structure.parts[block].module.decouple
        if decoupling is not None:
            held = held_during(pressed, bindings[block].get(decoupling.action, ()), times)
            let_go[:, k] = np.logical_or.accumulate(held)
    grab, release = _grip_keys(structure, bindings, pressed, times)
    return ForceSchedule(
        pushing=pushing,
        heights=heights,
        let_go=let_go,
        rests=_rests(structure, bindings, pressed, times),
        grab=grab,
        release=release,
    )


def _grip_keys(
    structure: Structure, bindings: Bindings, pressed: Sequence[KeyHold], times: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Whether the keys that grab, and those that release, are held, each (S, G)."""
    grips = grips_of(structure)
    grab, release = (np.zeros((len(times), len(grips)), dtype=bool) for _ in range(2))
    for g, block in enumerate(grips.blocks):
        grip = structure.parts[block].module.grip
        if grip is not None:
            grab[:, g] = held_during(pressed, bindings[block].get(grip.grab, ()), times)
            release[:, g] = held_during(pressed, bindings[block].get(grip.release, ()), times)
    return grab, release


def _rests(
    structure: Structure, bindings: Bindings, pressed: Sequence[KeyHold], times: FloatArray
) -> FloatArray:
    """Length of each spring at rest, (S, K), as a share of its built length."""
    rests = np.ones((len(times), len(structure.ropes.spring_of)))
    # Tests of structures alone give the keys of blocks only, or none.
    of_springs = [*bindings[len(structure) :], *({} for _ in structure.ropes.spring_of)]
    for k, (spring, bound) in enumerate(zip(structure.ropes.spring_of, of_springs, strict=False)):
        held = held_during(pressed, bound.get(spring.contract or "", ()), times)
        if held.any():
            rests[:, k] = _drawn(held, spring, float(times[1]))
    return rests


def _drawn(held: BoolArray, spring: Spring, time_step_s: float) -> FloatArray:
    """Share of its built length that a spring has at rest, (S,): it goes to and fro evenly."""
    step, share = spring.rate * time_step_s, 1.0
    shares = np.ones(len(held))
    for k, contracts in enumerate(held.tolist()):
        shares[k] = share = (
            max(spring.shortest, share - step) if contracts else min(1.0, share + step)
        )
    return shares
