"""What a design consists of, and a sketch that finds blocks and faces by their places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from buildarena_geometry import Machine

NEAR = 1e-6
Action = tuple[str, Mapping[str, Any]]
Place = tuple[float, float, float]

EAST, WEST = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
NORTH, SOUTH = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartDesign:
    """A sub-structure and the actions that build it.

    Attributes:
        description: Shape and size, for the plan.
        actions: Tool names and arguments, in order.
        refinements: Actions of the refine stage.
    """

    description: str
    actions: Sequence[Action]
    refinements: Sequence[Action] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A whole machine.

    Attributes:
        overall: What it is, for the plan.
        parts: Sub-structures by name, in building order.
        assembly: Actions that put several sub-structures together.
        control: The controller's answer, for tasks that are driven.
    """

    overall: str
    parts: Mapping[str, PartDesign]
    assembly: Sequence[Action] = ()
    control: Mapping[str, Any] | None = None


@dataclass(slots=True)
class Sketch:
    """A machine under construction that is told places instead of numbers and letters.

    Attributes:
        machine: The machine so far.
        actions: The actions that made it.
    """

    machine: Machine = field(default_factory=Machine)
    actions: list[Action] = field(default_factory=list)

    def do(self, name: str, **arguments: Any) -> None:
        """Carries out an action that must be accepted.

        Raises:
            ValueError: It was refused: the design is wrong.
        """
        outcome = self.machine.act(name, arguments)
        if not outcome.ok:
            raise ValueError(f"{name}({arguments}): {outcome.text}")
        self.actions.append((name, arguments))

    def start(self, note: str) -> None:
        """Places the starting block at the origin."""
        self.do("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note=note)

    def attach(
        self, base: Place, direction: Place, module: str = "Small Wooden Block", note: str = ""
    ) -> str:
        """Attaches a block to the side of the block at a place.

        Args:
            base: Centre of the base block, world frame, units.
            direction: Outward normal of the side, world frame.
            module: What to attach.
            note: Why.

        Returns:
            The new block's id.
        """
        block_id = self.at(base)
        face = self.face(block_id, direction)
        self.do("attach_block_to", base_block=block_id, face=face, new_block=module, note=note)
        return list(self.machine.blocks)[-1]

    def connect(
        self,
        start: tuple[Place, Place],
        end: tuple[Place, Place],
        connector: str = "Brace",
        note: str = "",
    ) -> None:
        """Joins a side of one block with a side of another, each given by centre and normal."""
        block_a, block_b = self.at(start[0]), self.at(end[0])
        self.do(
            "connect_blocks",
            block_a=block_a,
            face_a=self.face(block_a, start[1]),
            block_b=block_b,
            face_b=self.face(block_b, end[1]),
            connector=connector,
            note=note,
        )

    def at(self, place: Place) -> str:
        """The id of the block whose centre is at a place.

        Raises:
            ValueError: There is none.
        """
        for block_id, block in self.machine.blocks.items():
            if np.allclose(block.center, place, atol=NEAR):
                return block_id
        raise ValueError(f"no block at {place}")

    def face(self, block_id: str, direction: Place) -> str:
        """The letter of a block's side that looks in a direction.

        Raises:
            ValueError: There is none.
        """
        block = self.machine.blocks[block_id]
        for face in block.module.faces:
            if np.allclose(block.face_normal(face.label), direction, atol=NEAR):
                return face.label
        raise ValueError(f"block {block_id} has no side towards {direction}")
