"""Key presses of a trial, and the resulting commands to motors."""

from collections.abc import Mapping, Sequence

import numpy as np

from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_geometry import Block, KeyPress
from buildarena_simulation.control import PRESSES, channel, held_during, read_presses


def presses_of(run: Run) -> "Sequence[KeyPress]":
    """Return the key presses of a trial: the machine's own where the trajectory has none."""
    written = run.trajectory.settings.get(PRESSES)
    return run.machine.control_sequence if written is None else read_presses(str(written))


def motor_presses(run: Run) -> Mapping[str, Sequence[KeyPress]]:
    """Return the presses that reach each motor, by block id; motors without any are absent."""
    reached = {
        block.id: [press for press in presses_of(run) if press.key in _motor_keys(block)]
        for block in run.machine.blocks.values()
    }
    return {block: pressed for block, pressed in reached.items() if pressed}


def held(block: Block, action: str, presses: Sequence[KeyPress], run: Run) -> Mask:
    """Return when a key of one of a block's actions is held, (T,)."""
    return held_during(presses, keys_of(block, action), np.asarray(run.time_s))


def keys_of(block: "Block", action: str) -> tuple[str, ...]:
    """Return the triggers of a block's action: its keys, and a controller's name for it."""
    return (*block.bindings.get(action, ()), channel(block.id, action))


def _motor_keys(block: "Block") -> set[str]:
    motor = block.module.motor
    if motor is None:
        return set()
    return {key for way in (motor.forward, motor.backward) for key in keys_of(block, way)}
