"""The figures of a leaderboard's rows that reports and the paper's tables show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A figure of a leaderboard's rows: of our cells, and of the paper's rows if it has it.

    Attributes:
        name: The attribute that holds it.
        heading: What reports call it.
        latex: What the paper's tables call it; None for what they do not have.
        digits: Digits after the point in reports.
        power: Power of ten that it is divided by in the paper's tables.
        more: Whether more is better.
    """

    name: str
    heading: str
    latex: str | None = None
    digits: int = 1
    power: int = 0
    more: bool = False

    def value(self, row: object) -> float | None:
        """The figure of a row; None if the row, or the row's figure, does not exist."""
        value: float | None = getattr(row, self.name, None)
        return value

    def is_bound(self, row: object) -> bool:
        """Whether the figure is at least what it says: a mean over bridges that carried all."""
        return self in (INDICATOR, BEST) and bool(getattr(row, "censored", 0))

    def text(self, row: object) -> str:
        """The figure of a row for people."""
        value = self.value(row)
        if value is None:
            return "-"
        if self is SUCCESS:
            return f"{100 * value:.{self.digits}f} %"
        return ("≥ " if self.is_bound(row) else "") + f"{value:,.{self.digits}f}"


PARTS: Final = Column(name="parts_mean", heading="parts", latex="Number of Parts", more=True)
SUCCESS: Final = Column(
    name="success_rate", heading="success", latex=r"Success Rate (\%)↑", power=-2, more=True
)
INDICATOR: Final = Column(name="indicator_mean", heading="indicator", latex="Indicator↑", more=True)
BEST: Final = Column(name="indicator_best", heading="best", more=True)
INPUT_TOKENS: Final = Column(
    name="input_tokens_mean",
    heading="input tokens",
    latex=r"\# Input Tokens ($\times 10^3$)↓",
    digits=0,
    power=3,
)
OUTPUT_TOKENS: Final = Column(
    name="output_tokens_mean",
    heading="output tokens",
    latex=r"\# Output Tokens ($\times 10^3$)↓",
    digits=0,
    power=3,
)
REQUESTS: Final = Column(name="requests_mean", heading="requests", latex=r"\# LLM Requests↓")
COST: Final = Column(name="cost_usd_mean", heading="USD", digits=4)
