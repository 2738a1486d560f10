"""A policy that writes bridges: a grammar over building actions with a probability for each choice.

A bridge is a row of blocks to both sides of the starting block, up to two more rows beside it, and
connectors between faces that look alike. Nothing else is said: neither that a bridge must reach
both terrains, nor that connectors make it stronger, nor where they belong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from buildarena_environment import Environment
from buildarena_geometry import Block

Direction = tuple[int, int, int]
Brace = tuple[int, int, int, Direction]
"""Row, first block, blocks from one end to the other, and the side that its ends are on."""

EAST, WEST, NORTH, SOUTH = (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)
UP, DOWN = (0, 0, 1), (0, 0, -1)
LENGTHS: Final = tuple(range(7))
ROWS: Final = (1, 2, 3)
SPANS: Final = (2, 3, 4, 5, 6)
BRACES: Final[tuple[Brace, ...]] = tuple(
    product(range(3), range(-6, 6), SPANS, (UP, DOWN, EAST, WEST))
)
TIES: Final[tuple[tuple[int, Direction], ...]] = tuple(product(range(-6, 7), (UP, DOWN)))
"""Connectors across the rows: at which block along them, and on which side."""
WOOD: Final = "Small Wooden Block"
ALIGNED: Final = 0.99


@dataclass(frozen=True, slots=True, kw_only=True)
class Bridge:
    """The choices that make a bridge; indices into the tables above.

    Attributes:
        north: Blocks to the north of the starting block, by `LENGTHS`.
        south: Blocks to its south.
        rows: By `ROWS`.
        braces: Which of `BRACES` there are; those whose blocks are missing are passed over.
        ties: Which of `TIES` there are.
    """

    north: int
    south: int
    rows: int
    braces: NDArray[np.bool_]
    ties: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """How likely each choice is.

    Attributes:
        north: (7,) of `LENGTHS`.
        south: (7,) of `LENGTHS`.
        rows: (3,) of `ROWS`.
        braces: (B,) of each of `BRACES`.
        ties: (T,) of each of `TIES`.
    """

    north: NDArray[np.float64]
    south: NDArray[np.float64]
    rows: NDArray[np.float64]
    braces: NDArray[np.float64]
    ties: NDArray[np.float64]

    @classmethod
    def ignorant(cls) -> Self:
        """One that knows nothing: every length and width alike, a connector here and there."""
        return cls(
            north=np.full(len(LENGTHS), 1 / len(LENGTHS)),
            south=np.full(len(LENGTHS), 1 / len(LENGTHS)),
            rows=np.full(len(ROWS), 1 / len(ROWS)),
            braces=np.full(len(BRACES), 0.004),
            ties=np.full(len(TIES), 0.01),
        )

    def sample(self, draw: np.random.Generator) -> Bridge:
        """A bridge drawn by it."""
        return Bridge(
            north=int(draw.choice(len(LENGTHS), p=self.north)),
            south=int(draw.choice(len(LENGTHS), p=self.south)),
            rows=int(draw.choice(len(ROWS), p=self.rows)),
            braces=draw.random(len(BRACES)) < self.braces,
            ties=draw.random(len(TIES)) < self.ties,
        )

    def towards(self, elite: Sequence[Bridge], *, step: float, floor: float) -> Self:
        """The policy moved towards the choices of the best bridges.

        Args:
            elite: The best.
            step: How far, 0 to 1.
            floor: No choice gets less likely than this, nor its opposite.
        """

        def blended(before: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.clip((1 - step) * before + step * seen, floor, 1 - floor)

        def shares(before: NDArray[np.float64], chosen: Sequence[int]) -> NDArray[np.float64]:
            seen = np.bincount(chosen, minlength=len(before)) / len(chosen)
            mixed = blended(before, seen)
            return mixed / mixed.sum()

        return replace(
            self,
            north=shares(self.north, [bridge.north for bridge in elite]),
            south=shares(self.south, [bridge.south for bridge in elite]),
            rows=shares(self.rows, [bridge.rows for bridge in elite]),
            braces=blended(self.braces, np.mean([bridge.braces for bridge in elite], axis=0)),
            ties=blended(self.ties, np.mean([bridge.ties for bridge in elite], axis=0)),
        )


def built(environment: Environment, bridge: Bridge) -> None:
    """Builds a bridge, step by step; what is refused is left out."""
    environment.reset()
    environment.step("start")
    rows: dict[tuple[int, int], str] = {}
    rows[0, 0] = "1"
    for row, side in list(zip((1, 2), (EAST, WEST), strict=True))[: ROWS[bridge.rows] - 1]:
        _attach(environment, rows, (0, 0), (row, 0), side)
    for row in sorted({row for row, _ in rows}):
        for way, sign, length in ((NORTH, 1, bridge.north), (SOUTH, -1, bridge.south)):
            for place in range(1, LENGTHS[length] + 1):
                _attach(environment, rows, (row, sign * (place - 1)), (row, sign * place), way)
    for first, second, side in _links(bridge):
        if first in rows and second in rows:
            _connect(environment, rows[first], rows[second], side)


def _links(bridge: Bridge) -> Iterator[tuple[tuple[int, int], tuple[int, int], Direction]]:
    for chosen, (row, first, span, side) in zip(bridge.braces, BRACES, strict=True):
        if chosen:
            yield (row, first), (row, first + span), side
    for chosen, (place, side) in zip(bridge.ties, TIES, strict=True):
        if chosen:
            yield (0, place), (1, place), side
            yield (0, place), (2, place), side


def _attach(
    environment: Environment,
    rows: dict[tuple[int, int], str],
    base: tuple[int, int],
    place: tuple[int, int],
    way: Direction,
) -> None:
    if base not in rows:
        return
    face = _face(environment, rows[base], way)
    told = {"base_block": rows[base], "face": face, "new_block": WOOD}
    if _done(environment, "attach_block_to", told):
        rows[place] = list(environment.machines["main"].blocks)[-1]


def _connect(environment: Environment, first: str, second: str, side: Direction) -> None:
    told = {
        "block_a": first,
        "face_a": _face(environment, first, side),
        "block_b": second,
        "face_b": _face(environment, second, side),
        "connector": "Brace",
    }
    _done(environment, "connect_blocks", told)


def _done(environment: Environment, tool: str, arguments: Mapping[str, Any]) -> bool:
    return environment.step(tool, dict(arguments)).ok


def _face(environment: Environment, block: str, way: Direction) -> str:
    """The label of the face that looks a way."""
    found: Block = environment.machines["main"].blocks[block]
    for face in found.module.faces:
        if np.dot(found.face_normal(face.label), way) > ALIGNED:
            return face.label
    return ""
