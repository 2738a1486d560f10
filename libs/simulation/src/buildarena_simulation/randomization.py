"""Randomized parts of a scenario: a path to figures and a range for each.

A path names a field, and among places its name, among terrains and pushes its number from 1:
`placement.height`, `marks.goal.center`, `terrain.2.slope_deg`. Figures are uniformly distributed.
Each path has a separate generator, so that another range does not change the other figures.
"""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Annotated, Any, Final

from pydantic import Field

Figure = Annotated[float, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
Path = Annotated[str, Field(pattern=r"^[\w -]+(\.[\w -]+)*$", max_length=100)]
Figures = Figure | Annotated[tuple[Figure, ...], Field(min_length=1, max_length=3)]
Range = tuple[Figures, Figures]
"""Minimum and maximum; for a vector, of each figure."""
Randomization = Annotated[Mapping[Path, Range], Field(max_length=64)]

ROOTS: Final = (
    "terrain",
    "cargo",
    "placement",
    "gates",
    "marks",
    "line",
    "gusts",
    "pushes",
    "fuel_s",
    "gravity",
    "drive_strength",
    "planet",
)
"""Fields of a scenario that can be randomized."""
_DIGITS: Final = 3
"""Decimals of a random figure."""


def randomize(
    document: Mapping[str, Any], ranges: Mapping[str, Range], seed: int
) -> dict[str, Any]:
    """Return a scenario's document with the figures that a seed draws.

    Args:
        document: Scenario as JSON values; not modified.
        ranges: Ranges by path.
        seed: Seed of the trial.

    Raises:
        ValueError: A path leads to no figures; the message names it and the valid choices.
    """
    return _replaced(document, {path: _sample(path, ends, seed) for path, ends in ranges.items()})


def at_end(document: Mapping[str, Any], ranges: Mapping[str, Range], end: int) -> dict[str, Any]:
    """Return a scenario's document with every range at its minimum, `end` 0, or maximum, `end` 1.

    Raises:
        ValueError: A path leads to no figures, or a range is invalid.
    """
    for path, (minimum, maximum) in ranges.items():
        low, high = _figures(minimum), _figures(maximum)
        if len(low) != len(high) or any(a > b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"randomization.{path}: {minimum} to {maximum} is not a range")
    return _replaced(document, {path: ends[end] for path, ends in ranges.items()})


def between(name: str, low: Sequence[float], high: Sequence[float], seed: int) -> tuple[float, ...]:
    """Draw figures for a name, uniformly between ends; each name has a separate generator."""
    draw = Random(f"{name} {seed}")  # noqa: S311 - to be repeatable, not secret
    pairs = zip(low, high, strict=True)
    return tuple(round(draw.uniform(minimum, maximum), _DIGITS) for minimum, maximum in pairs)


def _sample(path: str, ends: Range, seed: int) -> Figures:
    values = between(path, _figures(ends[0]), _figures(ends[1]), seed)
    return values if isinstance(ends[0], tuple) else values[0]


def _figures(value: Figures) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


def _replaced(document: Mapping[str, Any], values: Mapping[str, Figures]) -> dict[str, Any]:
    replaced = {name: _copied(value) for name, value in document.items()}
    for path, value in values.items():
        *parents, last = path.split(".")
        if path.partition(".")[0] not in ROOTS:
            raise ValueError(f"randomization.{path}: what can be drawn is in {', '.join(ROOTS)}")
        holder: Any = replaced
        for part in parents:
            holder = holder[_key(holder, part, path)]
        key = _key(holder, last, path)
        now = holder[key]
        if _shape(now) != _shape(value):
            raise ValueError(f"randomization.{path}: the value is {now!r}, not {_shape(value)}")
        holder[key] = list(value) if isinstance(value, tuple) else value
    return replaced


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _copied(inner) for name, inner in value.items()}
    return [_copied(inner) for inner in value] if isinstance(value, list) else value


def _key(holder: Any, part: str, path: str) -> Any:
    """Return the key or index of a part of a path in an object or a list."""
    if isinstance(holder, dict):
        names = {name: name for name in holder}
    else:
        rows = holder if isinstance(holder, Sequence) and not isinstance(holder, str) else ()
        names = {str(row["name"]): k for k, row in enumerate(rows) if _has_name(row)}
        names = names or {str(k): k - 1 for k, _ in enumerate(rows, 1)}
    if part not in names:
        choices = ", ".join(map(str, names)) or "nothing"
        raise ValueError(f"randomization.{path}: there is no {part!r}, but {choices}")
    return names[part]


def _has_name(row: Any) -> bool:
    return isinstance(row, dict) and "name" in row


def _shape(value: Any) -> str:
    if isinstance(value, list | tuple) and all(_is_number(each) for each in value):
        return f"{len(value)} figures"
    return "a figure" if _is_number(value) else "anything else"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
