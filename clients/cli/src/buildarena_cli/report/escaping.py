"""Texts in Markdown and Typst: names of models and texts of tasks come from strangers."""

from __future__ import annotations

import re
from typing import Final

MARKDOWN: Final = re.compile(
    r"[\\`*\[\]<>|&~$#]"  # code, emphasis, links, tags, columns, entities, formulas, headings
    r"|(?<![^\W_])_|_(?![^\W_])"  # between two letters it is only itself
    r"|(?<=:)/(?=/)|(?<=www)\.|@"  # addresses, which would become links
)
LINE_START: Final = re.compile(r"^([-+=]|\d+(?=[.)]))")
"""What begins a list or underlines a heading."""
LONG_WORD: Final = re.compile(r"\S{40}(?=\S)")
BREAK: Final = "\u200b"
"""A place where a line may end, of no width."""


def one_line(text: str) -> str:
    """A text without line ends and control characters."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text)


def markdown_cell(text: str) -> str:
    """A text inside a line of Markdown, where nothing of it is markup."""
    return MARKDOWN.sub(lambda match: f"\\{match[0]}", one_line(text))


def markdown_line(text: str) -> str:
    """A text that begins a line of Markdown."""
    escaped = markdown_cell(text).lstrip()
    return LINE_START.sub(
        lambda match: f"{match[0]}\\" if match[0].isdigit() else f"\\{match[0]}", escaped
    )


def typst_string(text: str) -> str:
    """A text as a string of Typst's code, in which nothing is markup.

    Words that no page is wide enough for get places to break at.
    """
    broken = LONG_WORD.sub(lambda match: match[0] + BREAK, one_line(text))
    escaped = broken.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
