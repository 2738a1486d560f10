"""Tables in the layout of the BuildArena paper: categories down, levels across.

In each column the best figure is bold and the second-best underlined, ties alike, as the paper
marks its own: where two are best, none is second.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A figure of our cells and of the paper's rows.

    Attributes:
        name: Name of the row's attribute.
        power: Power of ten by which it is divided.
        more: Whether more is better.
    """

    name: str
    latex: str
    power: int = 0
    more: bool = False

    def printed(self, row: object) -> float | None:
        """Return a row's figure to one decimal, which also decides ties; None without one."""
        value: float | None = getattr(row, self.name, None)
        return None if value is None else round(value / 10.0**self.power, 1)

    def is_bound(self, row: object) -> bool:
        """Return whether the figure is a lower bound: a mean over bridges that never fell."""
        return self is INDICATOR and bool(getattr(row, "censored", 0))


INDICATOR: Final = Column(name="indicator_mean", latex="Indicator↑", more=True)
PERFORMANCE: Final = (
    Column(name="parts_mean", latex="Number of Parts", more=True),
    Column(name="success_rate", latex=r"Success Rate (\%)↑", power=-2, more=True),
    INDICATOR,
)
COST: Final = (
    Column(name="input_tokens_mean", latex=r"\# Input Tokens ($\times 10^3$)↓", power=3),
    Column(name="output_tokens_mean", latex=r"\# Output Tokens ($\times 10^3$)↓", power=3),
    Column(name="requests_mean", latex=r"\# LLM Requests↓"),
)
LEVELS = (1, 2, 3)


class Figures(Protocol):
    """Anything that has a model's figures on a task: our cells and the paper's rows."""

    @property
    def model(self) -> str:
        """The model's name."""


Cells = Mapping[str, Sequence[Figures]]
"""Rows by task; tasks are named ``category-level``."""


def performance_table(cells: Cells) -> str:
    """Return part, success rate and indicator of each model; tasks that are absent show dashes."""
    return _table(cells, PERFORMANCE)


def cost_table(cells: Cells) -> str:
    """Return the tokens and requests of each model."""
    return _table(cells, COST)


def plain_table(cells: Cells) -> str:
    """Return performance and cost of each model on tasks without levels, a line for each."""
    columns = (*PERFORMANCE, *COST)
    lines = [
        r"\begin{tabular}{ll" + "c" * len(columns) + "}",
        r"\toprule",
        f"Task & Model & {' & '.join(column.latex for column in columns)} \\\\",
    ]
    for task, rows in cells.items():
        lines += [r"\midrule", rf"\multirow{{{len(rows)}}}{{*}}{{{_escape(task)}}}"]
        texts = [
            _mark(
                [column.printed(row) for row in rows],
                [column.is_bound(row) for row in rows],
                more=column.more,
            )
            for column in columns
        ]
        lines += [
            rf"& {_escape(row.model)} & {' & '.join(column[i] for column in texts)} \\"
            for i, row in enumerate(rows)
        ]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _table(cells: Cells, columns: Sequence[Column]) -> str:
    groups = " & ".join(rf"\multicolumn{{3}}{{c}}{{{column.latex}}}" for column in columns)
    levels = " & ".join(f"Lv.{level}" for _ in columns for level in LEVELS)
    lines = [
        r"\begin{tabular}{ll" + "c" * 3 * len(columns) + "}",
        r"\toprule",
        rf"\multirow{{2}}{{*}}{{Task}} & \multirow{{2}}{{*}}{{Model}} & {groups} \\",
        rf"& & {levels} \\",
    ]
    categories = dict.fromkeys(task.rsplit("-", 1)[0] for task in cells)
    for category in categories:
        lines += [r"\midrule", *_category(cells, category, columns)]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _category(cells: Cells, category: str, columns: Sequence[Column]) -> list[str]:
    tasks = [f"{category}-{level}" for level in LEVELS]
    models = list(dict.fromkeys(row.model for task in tasks for row in cells.get(task, ())))
    texts: list[list[str]] = []
    for column in columns:
        for task in tasks:
            rows = {row.model: row for row in cells.get(task, ())}
            shown = [column.printed(rows.get(model)) for model in models]
            bounds = [column.is_bound(rows.get(model)) for model in models]
            texts.append(_mark(shown, bounds, more=column.more))
    lines = [rf"\multirow{{{len(models)}}}{{*}}{{{_escape(category.capitalize())}}}"]
    for number, model in enumerate(models):
        values = " & ".join(shown[number] for shown in texts)
        lines.append(rf"& {_escape(model)} & {values} \\")
    return lines


def _mark(values: Sequence[float | None], bounds: Sequence[bool], *, more: bool) -> list[str]:
    descending = sorted((value for value in values if value is not None), reverse=more)
    # Where all values are zero, none is the best.
    places = [value for value in descending if value != 0.0 or not more][:2]
    texts = []
    for value, bound in zip(values, bounds, strict=True):
        text = "--" if value is None else (r"$\geq$" if bound else "") + f"{value:.1f}"
        if places and value == places[0]:
            text = rf"\textbf{{{text}}}"
        elif len(places) > 1 and value == places[1]:
            text = rf"\underline{{{text}}}"
        texts.append(text)
    return texts


def _escape(text: str) -> str:
    special = {char: "\\" + char for char in "&%$#_{}"} | {"\\": r"\textbackslash{}"}
    return "".join(special.get(char, char) for char in text)
