"""The plots of reports. Colours are Okabe and Ito's, which people of all eyes can tell apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, cast

from buildarena_benchmark.leaderboard import Cell, OverallRow, PublishedRow
from buildarena_benchmark.statistics import TokenBin

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

COLOURS: Final = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999",
)  # fmt: skip
DASHES: Final = ("-", "--", ":", "-.")
PAPER: Final = "#888888"
ACROSS: Final = 3
"""Panels beside each other: the three levels of a category."""

CellsByTask = Mapping[str, Sequence[Cell]]


def success_plot(cells: CellsByTask, published: Mapping[str, Mapping[str, PublishedRow]]) -> Figure:
    """Success rates with exact intervals, a panel for each task; the paper's as diamonds.

    Args:
        cells: Cells by task.
        published: The paper's rows by task and by our model's name.
    """
    return _dots(
        cells,
        published,
        lambda c: (c.success_rate, c.success_low, c.success_high),
        lambda p: p.success_rate,
        dict.fromkeys(cells, "success rate"),
        top=1.0,
    )


def indicator_plot(
    cells: CellsByTask,
    published: Mapping[str, Mapping[str, PublishedRow]],
    labels: Mapping[str, str],
) -> Figure:
    """Mean indicators with their intervals, a panel for each task.

    Args:
        cells: Cells by task.
        published: The paper's rows by task and by our model's name.
        labels: What each task's indicator is, with its unit.
    """
    return _dots(
        cells,
        published,
        lambda c: (c.indicator_mean, c.indicator_low, c.indicator_high),
        lambda p: p.indicator_mean,
        labels,
    )


def radar_plot(rows: Sequence[OverallRow]) -> Figure:
    """Scores along the difficulty dimensions, one line for each ranked model."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes = cast("PolarAxes", figure.add_subplot(projection="polar"))
    names = list(rows[0].dimensions)
    angles = [2 * math.pi * i / len(names) for i in range(len(names))]
    for number, row in enumerate(rows):
        values = [row.dimensions[name] for name in names]
        axes.plot(
            [*angles, angles[0]],
            [*values, values[0]],
            color=COLOURS[number % len(COLOURS)],
            linestyle=DASHES[number // len(COLOURS) % len(DASHES)],
            linewidth=2,
            label=row.model,
        )
    # The first label is on top, so that of six none is beside the circle at its widest.
    axes.set_theta_offset(math.pi / 2)
    axes.set_xticks(angles, [name.capitalize() for name in names])
    axes.tick_params(axis="x", pad=20)
    axes.set_rlabel_position(360 / len(names) / 2)
    axes.set_ylim(0, 1.02)
    axes.set_yticks([0.25, 0.5, 0.75, 1.0])
    figure.legend(loc="outside right center", frameon=False)
    return figure


def shares_plot(shares: Mapping[str, Mapping[str, int]], title: str) -> Figure:
    """Shares of classes as stacked bars, one for each row, with the number behind them.

    Args:
        shares: Counts by row and class.
        title: What is counted.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 1.6 + 0.42 * len(shares)), layout="constrained")
    axes = figure.add_subplot()
    totals = {row: sum(counts.values()) for row, counts in shares.items()}
    classes = sorted(
        {name for counts in shares.values() for name in counts},
        key=lambda name: -sum(counts.get(name, 0) for counts in shares.values()),
    )
    left = [0.0] * len(shares)
    for number, name in enumerate(classes):
        part = [
            counts.get(name, 0) / totals[row] if totals[row] else 0.0
            for row, counts in shares.items()
        ]
        axes.barh(
            range(len(shares)),
            part,
            left=left,
            color=COLOURS[number % len(COLOURS)],
            hatch="" if number < len(COLOURS) else "//",
            edgecolor="white",
            label=name.replace("_", " "),
        )
        left = [a + b for a, b in zip(left, part, strict=True)]
    axes.set_yticks(range(len(shares)), [f"{row} ({totals[row]:,})" for row in shares])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.set_xlabel(title)
    _tidy(axes)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize="small")
    return figure


def cost_plot(bins: Mapping[str, Sequence[TokenBin]]) -> Figure:
    """Normalised performance in bins of output tokens, a panel for each category."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.4), layout="constrained")
    panels = figure.subplots(1, len(bins), squeeze=False, sharey=True)[0]
    for axes, (category, category_bins) in zip(panels, bins.items(), strict=True):
        filled = [b for b in category_bins if b.trials]
        centres = [math.sqrt(b.low * b.high) for b in filled]
        axes.plot(centres, [b.mean for b in filled], "o-", color=COLOURS[0], label="mean")
        axes.plot(centres, [b.median for b in filled], "s--", color=COLOURS[1], label="median")
        for centre, entry in zip(centres, filled, strict=True):
            axes.annotate(
                str(entry.trials),
                (centre, entry.mean or 0.0),
                textcoords="offset points",
                xytext=(0, 8),
                ha="center",
                fontsize="small",
                color=PAPER,
            )
        axes.set_xscale("log")
        axes.set_ylim(-0.05, 1.15)
        axes.set_title(category)
        axes.set_xlabel("output tokens of a session")
        _tidy(axes)
    panels[0].set_ylabel("performance, best = 1")
    panels[0].legend(frameon=False)
    return figure


def rounds_plot(curves: Mapping[str, Sequence[tuple[float, float]]], indicator: str) -> Figure:
    """Closed loops: success rate and best indicator so far, by round.

    Args:
        curves: By model: after each round, the share that has succeeded and the mean of the
            best indicators so far.
        indicator: What the indicator is.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    first, second = figure.subplots(1, 2)
    for number, (model, curve) in enumerate(curves.items()):
        style = {
            "color": COLOURS[number % len(COLOURS)],
            "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
            "marker": "o",
        }
        rounds = range(1, len(curve) + 1)
        first.plot(rounds, [rate for rate, _ in curve], label=model, **style)
        second.plot(rounds, [value for _, value in curve], **style)
    first.set_ylim(-0.03, 1.03)
    first.set_ylabel("succeeded so far")
    second.set_ylabel(f"{indicator}, best so far")
    for axes in (first, second):
        axes.set_xlabel("round")
        axes.xaxis.get_major_locator().set_params(integer=True)
        _tidy(axes)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _dots(
    cells: CellsByTask,
    published: Mapping[str, Mapping[str, PublishedRow]],
    ours: Callable[[Cell], tuple[float | None, float | None, float | None]],
    theirs: Callable[[PublishedRow], float],
    labels: Mapping[str, str],
    *,
    top: float | None = None,
) -> Figure:
    from matplotlib.figure import Figure

    models = list(dict.fromkeys(cell.model for row in cells.values() for cell in row))
    down = math.ceil(len(cells) / ACROSS)
    across = min(ACROSS, len(cells))
    size = (3.2 + 3.1 * across, 0.6 + down * (0.9 + 0.33 * len(models)))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharey=True)
    for place, axes in enumerate(panels.flat):
        if place >= len(cells):
            axes.set_visible(False)
            continue
        task = list(cells)[place]
        for cell in cells[task]:
            row = models.index(cell.model)
            middle, low, high = ours(cell)
            if low is not None and high is not None:
                axes.plot([low, high], [row, row], color=COLOURS[0], linewidth=2)
            if middle is not None:
                axes.plot(middle, row, "o", color=COLOURS[0], label="measured, 95 %")
            paper = published.get(task, {}).get(cell.model)
            if paper is not None:
                axes.plot(theirs(paper), row, "D", mfc="none", color=PAPER, label="paper")
        axes.set_yticks(range(len(models)), models)
        axes.set_ylim(len(models) - 0.5, -0.5)
        axes.set_title(task)
        axes.set_xlabel(labels.get(task, ""))
        if top is not None:
            axes.set_xlim(-0.03, top * 1.03)
        else:
            axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
        _tidy(axes)
    shown: dict[str, Artist] = {}
    for axes in panels.flat:
        handles, texts = axes.get_legend_handles_labels()
        shown |= dict(zip(texts, handles, strict=True))
    if len(shown) > 1:
        figure.legend(
            shown.values(), shown.keys(), loc="outside lower center", ncols=2, frameon=False
        )
    return figure


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", color="#e5e5e5")
    axes.set_axisbelow(True)
