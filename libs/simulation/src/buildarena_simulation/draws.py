"""Parts of a scenario that the seed of a trial draws: each is a path to figures, and a range.

A path names a field, and among places its name, among terrains and pushes its number from 1:
`placement.height`, `marks.goal.center`, `terrain.2.slope_deg`. Figures are drawn evenly, those of
each path by a generator of its own, so that one range more leaves what others draw as it is.
"""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Annotated, Any, Final

from pydantic import Field

Figure = Annotated[float, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
Path = Annotated[str, Field(pattern=r"^[\w -]+(\.[\w -]+)*$", max_length=100)]
Figures = Figure | Annotated[tuple[Figure, ...], Field(min_length=1, max_length=3)]
Range = tuple[Figures, Figures]
"""Least and greatest; of a vector's every figure."""
Draws = Annotated[Mapping[Path, Range], Field(max_length=64)]

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
"""What of a scenario may be drawn."""
_DIGITS: Final = 3
"""A drawn figure has so many digits behind the point."""


def drawn(document: Mapping[str, Any], draws: Mapping[str, Range], seed: int) -> dict[str, Any]:
    """A scenario's document with what a seed draws in place of its own figures.

    Args:
        document: The scenario as JSON values; it is left as it is.
        draws: Ranges by path.
        seed: Of the trial.

    Raises:
        ValueError: There are no such figures; the message names the path and what there is.
    """
    return _replaced(document, {path: _drawn(path, ends, seed) for path, ends in draws.items()})


def at_end(document: Mapping[str, Any], draws: Mapping[str, Range], end: int) -> dict[str, Any]:
    """The same with the least figure of every range, `end` 0, or the greatest, `end` 1.

    Raises:
        ValueError: There are no such figures, or a range is none.
    """
    for path, (least, greatest) in draws.items():
        low, high = _figures(least), _figures(greatest)
        if len(low) != len(high) or any(a > b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"draws.{path}: {least} to {greatest} is no range")
    return _replaced(document, {path: ends[end] for path, ends in draws.items()})


def between(name: str, low: Sequence[float], high: Sequence[float], seed: int) -> tuple[float, ...]:
    """What a seed draws under a name, evenly between ends; each name has draws of its own."""
    draw = Random(f"{name} {seed}")  # noqa: S311 - to be repeatable, not secret
    pairs = zip(low, high, strict=True)
    return tuple(round(draw.uniform(least, greatest), _DIGITS) for least, greatest in pairs)


def _drawn(path: str, ends: Range, seed: int) -> Figures:
    values = between(path, _figures(ends[0]), _figures(ends[1]), seed)
    return values if isinstance(ends[0], tuple) else values[0]


def _figures(value: Figures) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


def _replaced(document: Mapping[str, Any], values: Mapping[str, Figures]) -> dict[str, Any]:
    made = {name: _copied(value) for name, value in document.items()}
    for path, value in values.items():
        *parents, last = path.split(".")
        if path.partition(".")[0] not in ROOTS:
            raise ValueError(f"draws.{path}: what can be drawn is in {', '.join(ROOTS)}")
        holder: Any = made
        for part in parents:
            holder = holder[_key(holder, part, path)]
        key = _key(holder, last, path)
        now = holder[key]
        if _shape(now) != _shape(value):
            raise ValueError(f"draws.{path}: {now!r} stands there, not {_shape(value)}")
        holder[key] = list(value) if isinstance(value, tuple) else value
    return made


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _copied(inner) for name, inner in value.items()}
    return [_copied(inner) for inner in value] if isinstance(value, list) else value


def _key(holder: Any, part: str, path: str) -> Any:
    """Where in an object or a list a part of a path leads."""
    if isinstance(holder, dict):
        names = {name: name for name in holder}
    else:
        rows = holder if isinstance(holder, Sequence) and not isinstance(holder, str) else ()
        names = {str(row["name"]): k for k, row in enumerate(rows) if _is_named(row)}
        names = names or {str(k): k - 1 for k, _ in enumerate(rows, 1)}
    if part not in names:
        choices = ", ".join(map(str, names)) or "nothing"
        raise ValueError(f"draws.{path}: there is no {part!r}, but {choices}")
    return names[part]


def _is_named(row: Any) -> bool:
    return isinstance(row, dict) and "name" in row


def _shape(value: Any) -> str:
    if isinstance(value, list | tuple) and all(_is_number(each) for each in value):
        return f"{len(value)} figures"
    return "a figure" if _is_number(value) else "anything else"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
