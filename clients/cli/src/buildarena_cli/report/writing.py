"""How reports are written: HTML, Markdown and PDF, each from a template of its own.

Every value that a template names is escaped for its format, without being asked to.
"""

from __future__ import annotations

import base64
import io
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from buildarena_cli.report.document import Block, Grid, Heading, Plot
from buildarena_cli.report.escaping import markdown_cell, markdown_line, typst_string

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI: Final = 130
LONG_TEXT: Final = 40
"""Letters of a cell that takes several lines of a page."""
DIGEST_SALT: Final = "buildarena"
"""Makes the ids inside equal SVG pictures equal."""


def write_report(blocks: Sequence[Block], out: Path) -> None:
    """Writes a report; the file's ending says how. Markdown's pictures lie beside it."""
    WRITERS[out.suffix](blocks, out)


def _title(blocks: Sequence[Block]) -> str:
    return next((block.text for block in blocks if isinstance(block, Heading)), "Report")


def _environment(escape: Callable[[str], str] | None) -> Environment:
    """Templates whose values go through `escape`; those of HTML escape by themselves."""

    def escaped(value: Any) -> Any:
        if escape is None or isinstance(value, Markup | int):
            return value
        return escape(value)

    made = Environment(
        loader=PackageLoader("buildarena_cli.report"),
        autoescape=escape is None,  # noqa: S701 - otherwise everything goes through `escape`
        finalize=escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.tests["a"] = lambda block, kind: type(block).__name__ == kind
    return made


def _picture(figure: Figure, kind: str) -> bytes:
    import matplotlib as mpl

    sink = io.BytesIO()
    # Neither dates nor random ids: the same report is the same file.
    with mpl.rc_context({"svg.hashsalt": DIGEST_SALT}):
        metadata = {"Date": None} if kind == "svg" else {}
        figure.savefig(sink, format=kind, dpi=DPI, metadata=metadata)
    return sink.getvalue()


def _write_html(blocks: Sequence[Block], out: Path) -> None:
    environment = _environment(None)

    def address(plot: Plot) -> str:
        return "data:image/png;base64," + base64.b64encode(_picture(plot.figure, "png")).decode()

    template = environment.get_template("report.html.j2")
    text = template.render(title=_title(blocks), blocks=blocks, address=address)
    out.write_text(text, encoding="utf-8")


def _write_markdown(blocks: Sequence[Block], out: Path) -> None:
    pictures = out.with_name(f"{out.stem}_files")
    environment = _environment(markdown_cell)
    environment.filters["line"] = lambda text: Markup(markdown_line(text))  # noqa: S704 - escaped

    def address(plot: Plot) -> Markup:
        pictures.mkdir(exist_ok=True)
        (pictures / f"{plot.name}.png").write_bytes(_picture(plot.figure, "png"))
        return Markup(quote(f"{pictures.name}/{plot.name}.png"))  # noqa: S704 - quoted

    text = environment.get_template("report.md.j2").render(blocks=blocks, address=address)
    out.write_text(text.strip("\n") + "\n", encoding="utf-8")


def _write_pdf(blocks: Sequence[Block], out: Path) -> None:
    import typst
    from matplotlib import get_data_path

    environment = _environment(typst_string)
    environment.filters["long_columns"] = _long_columns
    with tempfile.TemporaryDirectory() as folder:

        def address(plot: Plot) -> str:
            name = f"{blocks.index(plot)}.svg"
            Path(folder, name).write_bytes(_picture(plot.figure, "svg"))
            return name

        template = environment.get_template("report.typ.j2")
        source = template.render(title=_title(blocks), sections=_sections(blocks), address=address)
        main = Path(folder, "report.typ")
        main.write_text(source, encoding="utf-8")
        # Letters come with Matplotlib; those that it lacks, from the system if that has them.
        fonts = typst.Fonts(font_paths=[Path(get_data_path(), "fonts", "ttf")])
        out.write_bytes(typst.compile(main, root=Path(folder), font_paths=fonts, format="pdf"))


def _long_columns(grid: Grid) -> list[bool]:
    """Which columns hold texts so long that their lines may end within."""
    return [
        any(len(row[i]) > LONG_TEXT and " " in row[i] for row in grid.rows)
        for i in range(len(grid.columns))
    ]


def _sections(blocks: Sequence[Block]) -> list[list[Block]]:
    """The blocks in groups that lie on pages of one direction; only tables need broad ones."""
    sections: list[list[Block]] = []
    for block in blocks:
        before = type(sections[-1][-1]) if sections else None
        if isinstance(block, Heading) or not sections or {before, type(block)} == {Plot, Grid}:
            sections.append([])
        sections[-1].append(block)
    return sections


WRITERS: Final = {".html": _write_html, ".md": _write_markdown, ".pdf": _write_pdf}
