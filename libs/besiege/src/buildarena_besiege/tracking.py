"""Which blocks a trial reports."""

from __future__ import annotations

import zlib
from typing import Final

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_geometry import Machine
from buildarena_geometry.blocks import Block
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement

LINE_VERSION: Final = 2
"""Of the lines that a script prints; from 2 on they report the level that is open."""


def tracked_blocks(machine: Machine, scenario: Scenario) -> tuple[str, ...]:
    """Ids of the blocks whose positions a trial reports, the cargo apart.

    Those the scenario names; otherwise none of a machine that spans a gap, where the cargo decides;
    starting blocks and wheels of one that drives; all of any other.

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
    """The begin line's fields: what its log must agree with.

    Args:
        machine: The machine.
        scenario: What it is put through.
        tracked: The blocks that are reported.
        presses: How many key presses reach some action.
    """
    return f"{LINE_VERSION},{presses},{run_digest(machine, scenario, tracked)}"


def run_digest(machine: Machine, scenario: Scenario, tracked: tuple[str, ...]) -> int:
    """A number by which a log is known to be of this machine and scenario."""
    places = [f"{part.id} {part.module.name}" for part in machine.state.parts]
    if machine.controller:
        places.append(machine.controller)
    return zlib.crc32("\n".join([scenario.model_dump_json(), *tracked, "", *places]).encode())


def _guides_or_rolls(block: Block) -> bool:
    return block.module.kind in {"start", "wheel"}
