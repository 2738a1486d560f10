"""The kinds of arguments actions take: how they are described to models and how they are read.

An action's signature is annotated with these, and both its tool definition and the check of what
arrives are made from that one place.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeGuard

from buildarena_geometry.blocks import Block
from buildarena_geometry.json_values import LARGEST_INTEGER, check_controller, is_storable
from buildarena_geometry.outcomes import Cause, Refused
from buildarena_geometry.rotations import Vector

LARGEST_NUMBER = 1e6
"""Units, degrees or seconds; far beyond any machine, well within a float's digits."""
LONGEST_TEXT = 500  # characters of a note or a name
MAX_PRESSES = 100  # key presses that one call adds after the first
MAX_IDS = 1000  # blocks that one call names
_LONGEST_QUOTE = 40  # characters of what a message quotes
JsonSchema = dict[str, Any]


class RefusalError(Exception):
    """Stops an action from inside; the dispatcher returns its outcome."""

    def __init__(
        self,
        cause: Cause,
        text: str,
        overlaps: tuple[tuple[str, str], ...] = (),
        attempted: tuple[Block, ...] = (),
    ) -> None:
        """Create the refusal; `Refused` describes the arguments."""
        super().__init__(text)
        self.outcome = Refused(cause=cause, text=text, overlaps=overlaps, attempted=attempted)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A kind of argument.

    Attributes:
        schema: its JSON schema, without the description.
        read: makes the value an action takes from the JSON value that arrived; raises RefusalError.
    """

    schema: JsonSchema
    read: Callable[[str, object], Any]


def object_schema(properties: Mapping[str, Any], required: Iterable[str] = ()) -> JsonSchema:
    """Return the JSON schema of an object with these properties."""
    return {"type": "object", "properties": dict(properties), "required": list(required)}


def quote(value: object) -> str:
    """Format a value for a message: always short, without raising an error."""
    if isinstance(value, str):
        printable = "".join(char if char.isprintable() else "?" for char in value[:_LONGEST_QUOTE])
        return f'"{printable}…"' if len(value) > _LONGEST_QUOTE else f'"{printable}"'
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, int):
        return str(value) if abs(value) <= LARGEST_INTEGER else "a huge number"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    return "an object"


def malformed(text: str) -> RefusalError:
    """Return a refusal of arguments whose form the action does not take."""
    return RefusalError(Cause.MALFORMED_ARGUMENTS, text)


def _malformed(name: str, expected: str, value: object) -> RefusalError:
    return malformed(f"{name} must be {expected}, not {quote(value)}.")


def _is_integer(value: object) -> TypeGuard[int]:
    """Check if a value is an integer that every JSON reader can represent."""
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_INTEGER


def _read_id(name: str, value: object) -> str:
    return str(value) if _is_integer(value) else _read_text(name, value)


def _read_text(name: str, value: object) -> str:
    if not isinstance(value, str) or not is_storable(value):
        raise _malformed(name, "a text without NUL characters and lone surrogates", value)
    if len(value) > LONGEST_TEXT:
        raise _malformed(name, f"a text of at most {LONGEST_TEXT} characters", value)
    return value


def _read_program(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise _malformed(name, "a text", value)
    try:
        check_controller(value)
    except ValueError as error:
        raise malformed(f"{name}: {error}.") from None
    return value


def _read_number(name: str, value: object) -> float:
    if not _is_integer(value) and not (isinstance(value, float) and math.isfinite(value)):
        raise _malformed(name, "a finite number", value)
    if abs(value) > LARGEST_NUMBER:
        text = f"{name} must lie within ±{LARGEST_NUMBER:.0f}, not {quote(value)}."
        raise RefusalError(Cause.OUT_OF_RANGE, text)
    return float(value)


def _read_index(name: str, value: object) -> int:
    if isinstance(value, float) and value.is_integer() and abs(value) <= LARGEST_NUMBER:
        return int(value)
    if not _is_integer(value):
        raise _malformed(name, "a whole number", value)
    return value


def _read_vector(name: str, value: object) -> Vector:
    if not isinstance(value, list | tuple) or len(value) != 3:  # noqa: PLR2004  three components
        raise _malformed(name, "a list of three numbers", value)
    x, y, z = (_read_number(f"{name}[{index}]", entry) for index, entry in enumerate(value))
    return (x, y, z)


_PRESS_ARGUMENTS = ("time", "key", "hold_for")


def _read_presses(name: str, value: object) -> tuple[tuple[float, str, float], ...]:
    return tuple(_read_press(*entry) for entry in _entries(name, value, MAX_PRESSES, "presses"))


def _read_press(name: str, value: object) -> tuple[float, str, float]:
    if not isinstance(value, Mapping) or set(value) != set(_PRESS_ARGUMENTS):
        raise _malformed(name, f"an object with {', '.join(_PRESS_ARGUMENTS)}", value)
    time, key, hold_for = (value[argument] for argument in _PRESS_ARGUMENTS)
    return (
        _read_number(f"{name}.time", time),
        _read_text(f"{name}.key", key),
        _read_number(f"{name}.hold_for", hold_for),
    )


def _read_ids(name: str, value: object) -> tuple[str, ...]:
    return tuple(_read_id(*entry) for entry in _entries(name, value, MAX_IDS, "ids"))


def _entries(name: str, value: object, most: int, what: str) -> Iterator[tuple[str, object]]:
    """Yield the entries of a list, each with its name."""
    if not isinstance(value, list | tuple) or len(value) > most:
        raise _malformed(name, f"a list of at most {most} {what}", value)
    yield from ((f"{name}[{index}]", entry) for index, entry in enumerate(value))


def _read_plane(name: str, value: object) -> str:
    if value not in ("x", "y"):
        raise _malformed(name, '"x" or "y"', value)
    return str(value)


_KEY: JsonSchema = {"type": "string"}
_NUMBER: JsonSchema = {"type": "number"}
_PRESS = object_schema({"time": _NUMBER, "key": _KEY, "hold_for": _NUMBER}, _PRESS_ARGUMENTS)
_PRESSES: JsonSchema = {"type": "array", "items": _PRESS}
_VECTOR: JsonSchema = {"type": "array", "items": _NUMBER}

# Whole numbers are read too; the schema says text because not every provider takes two types.
BlockId = Annotated[str, Parameter({"type": "string"}, _read_id)]
BlockIds = Annotated[
    tuple[str, ...], Parameter({"type": "array", "items": {"type": "string"}}, _read_ids)
]
Plane = Annotated[str, Parameter({"type": "string", "enum": ["x", "y"]}, _read_plane)]
Name = Annotated[str, Parameter({"type": "string"}, _read_text)]
Key = Annotated[str, Parameter(_KEY, _read_text)]
Note = Name
ProgramText = Annotated[str, Parameter({"type": "string"}, _read_program)]
Number = Annotated[float, Parameter(_NUMBER, _read_number)]
Index = Annotated[int, Parameter({"type": "integer"}, _read_index)]
Presses = Annotated[tuple[tuple[float, str, float], ...], Parameter(_PRESSES, _read_presses)]
Triple = Annotated[Vector, Parameter(_VECTOR, _read_vector)]
