"""Blocks that a trial reports."""

from __future__ import annotations

import zlib
from typing import Final

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_geometry import Machine
from buildarena_geometry.blocks import Block
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement

LINE_VERSION: Final = 2
"""Version of the lines that a script prints; from 2 on they report the open level."""


def tracked_blocks(machine: Machine, scenario: Scenario) -> tuple[str, ...]:
    """Return ids of the blocks whose positions a trial reports, without the cargo.

    These are the blocks that the scenario names; otherwise none for a machine that spans a gap,
    where the cargo decides; starting blocks and wheels for one that drives; all for any other.

    Raises:
        MachineNotPlayableError: The scenario names a block that the machine does not have.
    """
    named = scenario.tracked_blocks
    if named != "all":
        missing = [block for block in named if block not in machine.blocks]
        if missing:
            raise MachineNotPlayableError(
                f"The machine has no block {missing[0]}, which is tracked."
            )
        return tuple(dict.fromkeys(named))
    if isinstance(scenario.placement, SpanPlacement):
        return ()
    drives = scenario.control.mode == "agent"
    return tuple(
        block.id for block in machine.blocks.values() if not drives or _guides_or_rolls(block)
    )


def begin_fields(
    machine: Machine, scenario: Scenario, tracked: tuple[str, ...], presses: int
) -> str:
    """Return the begin line's fields, which its log must match.

    Args:
        tracked: Blocks that are reported.
        presses: Number of key presses that reach some action.
    """
    return f"{LINE_VERSION},{presses},{run_digest(machine, scenario, tracked)}"


def run_digest(machine: Machine, scenario: Scenario, tracked: tuple[str, ...]) -> int:
    """Return a number that identifies the log of this machine and scenario."""
    places = [f"{part.id} {part.module.name}" for part in machine.state.parts]
    if machine.controller:
        places.append(machine.controller)
    return zlib.crc32("\n".join([scenario.model_dump_json(), *tracked, "", *places]).encode())


def _guides_or_rolls(block: Block) -> bool:
    return block.module.kind in {"start", "wheel"}
