"""Texts in Markdown: names of models and texts of tasks come from strangers."""

from __future__ import annotations

import re
from typing import Final

MARKDOWN: Final = re.compile(
    r"[\\`*\[\]<>|&~$#]"  # code, emphasis, links, tags, columns, entities, formulas, headings
    r"|(?<![^\W_])_|_(?![^\W_])"  # between two letters it is only itself
    r"|(?<=:)/(?=/)|(?<=www)\.|@"  # addresses, which would become links
)


def markdown_cell(text: str) -> str:
    """A text inside a line of Markdown, where nothing of it is markup."""
    line = "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text)
    return MARKDOWN.sub(lambda match: f"\\{match[0]}", line)
