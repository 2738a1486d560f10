"""Rows of the published runner's logs: `time, ID_name, value` or `time, ID_name, x, y, z`.

How numbers are written depends on the release of the runner and on the computer: one decimal or
two, a point or a comma. The script mod's interpreter ignores the precision that a script asks for
and writes numbers as the computer's culture does, so both are learnt from the rows. All numbers of
a log have the same number of decimals, which is how cut-off ones are recognised.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

DELIMITERS: Final = (",", ";", "\t")
POINTS: Final = (".", ",")

_LINE_ENDS: Final = re.compile(r"\r\n|\r|\n")
_MAX_ROW: Final = 600
_MAX_DECIMALS: Final = 6


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a log.

    Attributes:
        label: Time as printed, in units of the format's last decimal.
        name: Name of the block, without `ID_`.
        values: One number (a mass) or three (a position, the game's components, units).
        burning: State of a cannon; None in rows with numbers.
    """

    label: int
    name: str
    values: tuple[float, ...] = ()
    burning: bool | None = None


@dataclass(frozen=True, kw_only=True)
class RowFormat:
    """Format of the rows of a log.

    Attributes:
        delimiter: Separator of fields.
        point: Decimal separator.
        time_decimals: Decimals of times.
        decimals: Decimals of positions and masses.
    """

    delimiter: str = ","
    point: str = "."
    time_decimals: int = 1
    decimals: int = 1

    @property
    def label_s(self) -> float:
        """Resolution of printed times, seconds."""
        return float(10.0**-self.time_decimals)

    @property
    def rounding(self) -> float:
        """Maximum error of a printed value, with a margin for the rounding itself."""
        return float(0.51 * 10.0**-self.decimals)

    def row(self, line: str) -> Row | None:
        """Parse a row; return None if the line is not one, or a number of it is incomplete."""
        match = self._pattern.fullmatch(line)
        if match is None:
            return None
        label = round(self._number(match["time"]) / self.label_s)
        if match["state"]:
            return Row(label, match["name"], burning=match["state"] == "true")
        numbers = [match["first"], match["second"], match["third"]]
        return Row(label, match["name"], tuple(self._number(n) for n in numbers if n))

    def _number(self, text: str) -> float:
        return float(text.replace(self.point, "."))

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        gap = rf"[ \t]*{re.escape(self.delimiter)}[ \t]*"
        time, value = (
            rf"-?[0-9]{{1,7}}{re.escape(self.point)}[0-9]{{{count}}}"
            for count in (self.time_decimals, self.decimals)
        )
        name = rf"(?P<name>[^{re.escape(self.delimiter)}]{{1,100}}?)"
        numbers = rf"(?P<first>{value})(?:{gap}(?P<second>{value}){gap}(?P<third>{value}))?"
        return re.compile(
            rf"(?P<time>{time}){gap}ID_{name}{gap}(?:(?P<state>true|false)|{numbers})"
        )


def lines_of(text: str) -> Iterator[str]:
    """Yield the lines of a log that are not empty, without quotes and blanks around fields."""
    for line in _LINE_ENDS.split(text):
        cut = line[:_MAX_ROW].replace('"', "").strip(" \t\ufeff\x00\xa0")
        if cut:
            yield cut


def learnt_format(lines: Iterable[str]) -> RowFormat:
    """Return the format of most of the rows; the first release's if there are no rows."""
    counts: Counter[tuple[str, str, int, int]] = Counter()
    for line in lines:
        for delimiter, pattern in _SHAPES:
            match = pattern.match(line)
            if match:
                time, value = match["time"], match["value"]
                point = match["point"]
                counts[delimiter, point, len(time), len(value)] += 1
                break
    if not counts:
        return RowFormat()
    best = max(counts.values())
    delimiter, point, time_decimals, decimals = min(
        key for key, count in counts.items() if count == best
    )
    return RowFormat(
        delimiter=delimiter, point=point, time_decimals=time_decimals, decimals=decimals
    )


def _shape(delimiter: str) -> re.Pattern[str]:
    """Return a pattern for a row's label and first number, with any number of decimals."""
    gap, digits = rf"[ \t]*{re.escape(delimiter)}[ \t]*", rf"[0-9]{{1,{_MAX_DECIMALS}}}"
    return re.compile(
        rf"-?[0-9]{{1,7}}(?P<point>[.,])(?P<time>{digits}){gap}ID_[^{re.escape(delimiter)}]{{1,100}}?"
        rf"{gap}-?[0-9]{{1,7}}(?P=point)(?P<value>{digits})(?:{gap}|$)"
    )


_SHAPES: Final = [(delimiter, _shape(delimiter)) for delimiter in DELIMITERS]
