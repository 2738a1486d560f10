"""Reads JSON values that people wrote, and says where they went wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from buildarena_geometry.errors import GeometryError
    from buildarena_geometry.rotations import Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """One JSON value, the place it has in its file, and the error to raise about it."""

    value: object
    where: str
    error: type[GeometryError]

    def fail(self, expected: str) -> NoReturn:
        """Raises the reader's error: this place should hold what is expected."""
        shown = repr(self.value)
        shown = shown if len(shown) <= 60 else shown[:57] + "..."  # noqa: PLR2004  one line of a terminal
        raise self.error(f"{self.where}: expected {expected}, found {shown}")

    def fields(self, *, required: Collection[str], optional: Collection[str] = ()) -> Fields:
        """The value as an object with these fields and no others."""
        if not isinstance(self.value, dict):
            self.fail(f"an object with {', '.join(required)}")
        for name in required:
            if name not in self.value:
                raise self.error(f"{self.where}: {name} is missing")
        for name in self.value:
            if name not in required and name not in optional:
                known = ", ".join([*required, *optional])
                raise self.error(
                    f"{self.where}: there is no field {name!r}; the fields are {known}"
                )
        return Fields(reader=self, values=self.value)

    def items(self) -> Iterator[Reader]:
        """The entries of the value, which is a list."""
        if not isinstance(self.value, list | tuple):
            self.fail("a list")
        for index, entry in enumerate(self.value):
            yield Reader(value=entry, where=f"{self.where}[{index}]", error=self.error)

    def entries(self) -> Iterator[tuple[str, Reader]]:
        """The entries of the value, which is an object whose keys are names."""
        if not isinstance(self.value, dict):
            self.fail("an object")
        for key, entry in self.value.items():
            if not isinstance(key, str):
                self.fail("an object whose keys are texts")
            yield key, Reader(value=entry, where=f"{self.where}.{key}", error=self.error)

    def text(self, *, longest: int | None = None) -> str:
        """The value as a text."""
        if not isinstance(self.value, str):
            self.fail("a text")
        if longest is not None and len(self.value) > longest:
            self.fail(f"a text of at most {longest} characters")
        return self.value

    def choice(self, choices: Collection[str]) -> str:
        """The value as one of the given texts."""
        if not isinstance(self.value, str) or self.value not in choices:
            self.fail(f"one of {', '.join(choices)}")
        return self.value

    def truth(self) -> bool:
        """The value as true or false."""
        if not isinstance(self.value, bool):
            self.fail("true or false")
        return self.value

    def integer(self, *, least: int | None = None) -> int:
        """The value as a whole number."""
        value = self.value
        # JSON has one kind of number: 2.0 is as whole as 2.
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if not isinstance(value, int) or isinstance(value, bool):
            self.fail("a whole number")
        if least is not None and value < least:
            self.fail(f"a whole number of at least {least}")
        return value

    def number(self, *, least: float | None = None, above: float | None = None) -> float:
        """The value as a finite number."""
        if not isinstance(self.value, int | float) or isinstance(self.value, bool):
            self.fail("a number")
        try:
            number = float(self.value)
        except OverflowError:
            self.fail("a finite number")
        if not math.isfinite(number):
            self.fail("a finite number")
        if least is not None and number < least:
            self.fail(f"a number of at least {least:g}")
        if above is not None and number <= above:
            self.fail(f"a number above {above:g}")
        return number

    def numbers(self, count: int) -> tuple[float, ...]:
        """The value as a list of so many finite numbers."""
        if not isinstance(self.value, list | tuple) or len(self.value) != count:
            self.fail(f"{count} numbers")
        return tuple(entry.number() for entry in self.items())

    def vector(self) -> Vector:
        """The value as three finite numbers."""
        x, y, z = self.numbers(3)
        return (x, y, z)

    def direction(self) -> Vector:
        """The value as three finite numbers, a vector of length 1."""
        vector = self.vector()
        if abs(math.hypot(*vector) - 1) > 1e-6:  # noqa: PLR2004  what six written digits may miss
            self.fail("a direction, three numbers with length 1")
        return vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Fields:
    """The fields of a JSON object whose names have been checked."""

    reader: Reader
    values: dict[str, object]

    def __getitem__(self, name: str) -> Reader:
        where = f"{self.reader.where}.{name}"
        return Reader(value=self.values.get(name), where=where, error=self.reader.error)

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def items(self, name: str) -> list[Reader]:
        """The entries of a list that may be left out."""
        return list(self[name].items()) if name in self else []

    def text(self, name: str) -> str:
        """The text of a field that may be left out."""
        return self[name].text() if name in self else ""

    def has(self, name: str) -> bool:
        """Whether the field is there and not null."""
        return self.values.get(name) is not None
