"""Reports hold every figure in every format, and nothing in them is taken for markup."""

import html.parser
import re
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from pypdf import PdfReader

from buildarena_cli.report.document import Block, Grid, Heading, Paragraph, Plot
from buildarena_cli.report.escaping import markdown_cell, markdown_line, typst_string
from buildarena_cli.report.writing import write_report

pytestmark = pytest.mark.nightly

A4 = {(595, 842), (842, 595)}
HOSTILE = [
    "<script>alert(1)</script>",
    "a | b || c",
    "`code` ``` and *stars* _lines_ **bold**",
    "#set page(width: 1cm) #panic()",
    '"; #read("/etc/passwd") "',
    "$x^2$ @label <label> // comment /* more */",
    '\\n \\ \\" \\u{41}',
    "[a](javascript:alert(1)) ![b](c)",
    "= heading - list + list 1. list",
    "{{ 7 * 7 }} {% raw %} {# c #}",
    "&lt;b&gt; &amp; ~struck~",
    "https://example.org www.example.org a@example.org",
    "new\nline\ttab \x1b[31m\x00",
    "x" * 300,
    "äöü ß ≥ → Ω",
]


def plain(text: str) -> str:
    """A text without what line ends and breaks change."""
    kept = "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text)
    return re.sub(r"[\s\u200b]+", "", kept)


def pdf_text(path: Path) -> str:
    return plain("".join(page.extract_text() for page in PdfReader(path).pages))


def figure() -> Figure:
    drawn = Figure(figsize=(4, 2))
    drawn.add_subplot().plot([0, 1], [1, 0])
    return drawn


def wide_report(rows: int, columns: int) -> list[Block]:
    names = ["model", *(f"figure {i}" for i in range(1, columns))]
    return [
        Heading(text="A report", level=1),
        Paragraph(text="What it is about."),
        Heading(text="Section"),
        Grid(
            caption="Many figures",
            columns=names,
            rows=[
                [f"provider/model-{r}", *(f"{r}.{c:03d}" for c in range(1, columns))]
                for r in range(rows)
            ],
        ),
        Plot(name="plot", text="A line", figure=figure()),
    ]


class Seen(html.parser.HTMLParser):
    """The texts and the tags of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.tags: list[str] = []

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)
        assert attrs is not None


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("rows", "columns"), [(3, 4), (150, 14), (5, 40)])
def test_a_pdf_holds_every_figure_however_long_and_wide(tmp_path, rows, columns) -> None:
    report = wide_report(rows, columns)
    # The typesetter keeps hundreds of megabytes of a long report: they go with a process.
    with ProcessPoolExecutor(1, get_context("spawn")) as apart:
        apart.submit(write_report, report, tmp_path / "r.pdf").result()
    pages = PdfReader(tmp_path / "r.pdf").pages
    text = pdf_text(tmp_path / "r.pdf")
    (grid,) = (block for block in report if isinstance(block, Grid))
    for row in grid.rows:
        for cell in row:
            assert plain(cell) in text
    for page in pages:
        size = (round(float(page.mediabox.width)), round(float(page.mediabox.height)))
        assert size in A4
        _assert_inside(page, size)
    assert f"{len(pages)}/{len(pages)}" in text
    # The head of a table is repeated on each page that it reaches.
    assert text.count("figure1") - text.count("figure10") * (columns > 10) >= min(rows // 60, 2)


def _assert_inside(page, size: tuple[int, int]) -> None:
    places = []
    page.extract_text(visitor_text=lambda text, _, m, *__: places.append((text, m[4], m[5])))
    for text, x, y in places:
        if text.strip():
            assert 0 <= x <= size[0], text
            assert 0 <= y <= size[1], text


def hostile_report() -> list[Block]:
    return [
        Heading(text=HOSTILE[0], level=1),
        *(Paragraph(text=text) for text in HOSTILE),
        *(Heading(text=text) for text in HOSTILE),
        Grid(
            caption=HOSTILE[3],
            columns=["model", "n"],
            rows=[[text, "1"] for text in HOSTILE],
        ),
        Plot(name="plot", text=HOSTILE[4], figure=figure()),
    ]


def test_nothing_is_markup_in_html(tmp_path) -> None:
    write_report(hostile_report(), tmp_path / "r.html")
    seen = Seen()
    seen.feed((tmp_path / "r.html").read_text())
    assert set(seen.tags) == {
        *("html", "head", "meta", "title", "style", "body", "h1", "h2", "p", "img"),
        *("table", "caption", "thead", "tbody", "tr", "th", "td"),
    }
    text = "".join(seen.texts)
    assert all(text.count(hostile.strip()) >= 3 for hostile in HOSTILE)


def test_nothing_is_markup_in_typst(tmp_path) -> None:
    write_report(hostile_report(), tmp_path / "r.pdf")
    text = pdf_text(tmp_path / "r.pdf")
    for hostile in HOSTILE:
        assert text.count(plain(hostile).replace("\ufffd", "")) >= 3 or "\ufffd" in plain(hostile)
    assert not [p for p in PdfReader(tmp_path / "r.pdf").pages if "/Annots" in p]


def test_nothing_is_markup_in_markdown(tmp_path) -> None:
    markdown = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    write_report(hostile_report(), tmp_path / "r.md")
    source = (tmp_path / "r.md").read_text()
    assert not re.search(r"://|www\.|[^\\]@", source)
    page = markdown.render(source)
    seen = Seen()
    seen.feed(page)
    assert set(seen.tags) == {"h1", "h2", "p", "img", "table", "thead", "tbody", "tr", "th", "td"}
    text = plain("".join(seen.texts))
    assert all(text.count(plain(hostile)) >= 3 for hostile in HOSTILE)


@pytest.mark.parametrize(
    ("text", "cell", "line"),
    [
        ("construction_failed", "construction_failed", "construction_failed"),
        ("a|b", r"a\|b", r"a\|b"),
        ("_x_", r"\_x\_", r"\_x\_"),
        ("- 1", "- 1", r"\- 1"),
        ("12. x", "12. x", r"12\. x"),
        ("-", "-", r"\-"),
    ],
)
def test_markdown_is_escaped_no_more_than_it_must_be(text, cell, line) -> None:
    assert (markdown_cell(text), markdown_line(text)) == (cell, line)


def test_a_typst_string_is_one_string() -> None:
    assert typst_string('a"b\\c\nd') == '"a\\"b\\\\c d"'


def test_the_same_report_is_the_same_file(tmp_path) -> None:
    for ending in (".pdf", ".html", ".md"):
        found = []
        for name in ("one", "two"):
            folder = tmp_path / name
            folder.mkdir(exist_ok=True)
            write_report(wide_report(5, 5), folder / f"r{ending}")
            found.append((folder / f"r{ending}").read_bytes())
        assert found[0] == found[1], ending


def test_markdowns_pictures_are_found_whatever_the_files_name(tmp_path) -> None:
    write_report(wide_report(1, 2), tmp_path / "my report (1).md")
    text = (tmp_path / "my report (1).md").read_text()
    assert "](my%20report%20%281%29_files/plot.png)" in text
    assert (tmp_path / "my report (1)_files" / "plot.png").exists()
