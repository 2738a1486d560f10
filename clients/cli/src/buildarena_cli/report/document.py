"""Reports as values, and how they are written: HTML, Markdown, PDF."""

from __future__ import annotations

import base64
import html
import io
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI: Final = 130
PAGE_IN: Final = (8.27, 11.69)
"""A4."""
PAGE_LINES: Final = 84
PAGE_COLUMNS: Final = 108
MARGIN: Final = 0.06
"""Of a page, on each side, as a share of its width."""
TEXT_SIZE: Final = 7.5
"""In points; pages with wider tables have smaller letters, never cut ones."""
POINTS_AN_INCH: Final = 72
CHARACTER_WIDTH: Final = 0.61
"""Of the monospaced letters that Matplotlib brings, as a share of their size; a little more."""
STYLE: Final = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 75rem; margin: 2rem auto;
  padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto;
  font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #ddd; text-align: right;
  white-space: nowrap; }
th { border-bottom: 2px solid #888; }
.text { text-align: left; }
img { max-width: 100%; height: auto; }
caption { text-align: left; color: #555; padding-bottom: .3rem; }
@media (prefers-color-scheme: dark) { body { background: #16181c; color: #ddd; }
  th, td { border-color: #444; } caption { color: #aaa; } img { background: white; } }
"""


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


def write_report(blocks: Sequence[Block], out: Path) -> None:
    """Writes a report; the file's ending says how. Markdown's pictures lie beside it."""
    writer: Callable[[Sequence[Block], Path], None] = WRITERS[out.suffix]
    writer(blocks, out)


def _png(figure: Figure) -> bytes:
    sink = io.BytesIO()
    figure.savefig(sink, format="png", dpi=DPI)
    return sink.getvalue()


def _write_html(blocks: Sequence[Block], out: Path) -> None:
    title = next((b.text for b in blocks if isinstance(b, Heading)), "Report")
    body = "\n".join(_html(block) for block in blocks)
    out.write_text(
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head>\n"
        f"<body>\n{body}\n</body></html>\n",
        encoding="utf-8",
    )


def _html(block: Block) -> str:
    match block:
        case Heading():
            return f"<h{block.level}>{html.escape(block.text)}</h{block.level}>"
        case Paragraph():
            return f"<p>{html.escape(block.text)}</p>"
        case Plot():
            data = base64.b64encode(_png(block.figure)).decode()
            return (
                f'<p><img alt="{html.escape(block.text)}" src="data:image/png;base64,{data}"></p>'
            )
        case Grid():
            head = _html_row("th", block.columns, block.text_columns)
            rows = "\n".join(_html_row("td", row, block.text_columns) for row in block.rows)
            return (
                f"<table><caption>{html.escape(block.caption)}</caption>\n"
                f"<thead>{head}</thead>\n<tbody>\n{rows}\n</tbody></table>"
            )


def _html_row(tag: str, cells: Sequence[str], text_columns: int) -> str:
    made = [
        f"<{tag}{' class=text' if place < text_columns else ''}>{html.escape(cell)}</{tag}>"
        for place, cell in enumerate(cells)
    ]
    return f"<tr>{''.join(made)}</tr>"


def _write_markdown(blocks: Sequence[Block], out: Path) -> None:
    pictures = out.with_name(f"{out.stem}_files")
    texts = []
    for block in blocks:
        match block:
            case Heading():
                texts.append(f"{'#' * block.level} {block.text}")
            case Paragraph():
                texts.append(block.text)
            case Plot():
                pictures.mkdir(exist_ok=True)
                (pictures / f"{block.name}.png").write_bytes(_png(block.figure))
                texts.append(f"![{block.text}]({pictures.name}/{block.name}.png)")
            case Grid():
                texts.append("\n".join([f"{block.caption}:", "", *_pipes(block)]))
    out.write_text("\n\n".join(texts) + "\n", encoding="utf-8")


def _pipes(grid: Grid) -> Iterator[str]:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"

    yield line(grid.columns)
    marks = [":--" if i < grid.text_columns else "--:" for i in range(len(grid.columns))]
    yield "|" + "|".join(marks) + "|"
    for row in grid.rows:
        yield line(row)


def _write_pdf(blocks: Sequence[Block], out: Path) -> None:
    from matplotlib.backends.backend_pdf import PdfPages

    with PdfPages(out) as pages:
        lines: list[str] = []

        def flush() -> None:
            for start in range(0, len(lines), PAGE_LINES):
                pages.savefig(_page(lines[start : start + PAGE_LINES]))
            lines.clear()

        for block in blocks:
            match block:
                case Heading():
                    lines += ["", block.text, ("=" if block.level == 1 else "-") * len(block.text)]
                case Paragraph():
                    lines += ["", *textwrap.wrap(block.text, PAGE_COLUMNS)]
                case Grid():
                    lines += ["", *textwrap.wrap(block.caption, PAGE_COLUMNS), *_aligned(block)]
                case Plot():
                    flush()
                    pages.savefig(block.figure)
        flush()


def _page(lines: Sequence[str]) -> Figure:
    from matplotlib.figure import Figure

    page = Figure(figsize=PAGE_IN)
    widest = max(map(len, lines), default=0)
    room = PAGE_IN[0] * (1 - 2 * MARGIN) * POINTS_AN_INCH
    size = min(TEXT_SIZE, room / (CHARACTER_WIDTH * max(widest, 1)))
    # A dollar sign would begin a formula.
    page.text(
        *(MARGIN, 1 - MARGIN * PAGE_IN[0] / PAGE_IN[1], "\n".join(lines)),
        family="monospace",
        size=size,
        va="top",
        parse_math=False,
    )
    return page


def _aligned(grid: Grid) -> list[str]:
    table = [grid.columns, *grid.rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(grid.columns))]
    lines = []
    for row in table:
        cells = [
            cell.ljust(width) if i < grid.text_columns else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return [lines[0], "-" * len(lines[0]), *lines[1:]]


WRITERS: Final = {".html": _write_html, ".md": _write_markdown, ".pdf": _write_pdf}
