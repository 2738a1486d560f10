"""Reports as values: headings, prose, tables and plots, whatever format they are written in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """A heading; the title has level 1."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Paragraph:
    """Some prose."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A table; the first `text_columns` columns hold text, the others figures."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A figure with what it shows in words, for those who can't see it."""

    name: str
    text: str
    figure: Figure


Block = Heading | Paragraph | Grid | Plot
