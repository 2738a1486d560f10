"""Of the site of documents: pages and pictures that are made of the code, and links to them.

None of them is a file of the repository. Documents name them in words that read well without the
site, and here become links and pictures.
"""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path
from typing import Any

from buildarena_api.http.openapi import api_page
from docs_modules import module_guide
from docs_pictures import PICTURES, pictures
from mkdocs.structure.files import File

LOG = logging.getLogger("mkdocs.hooks.generated")
TESTS = str(Path(__file__).parents[1] / "tests")
PAGES = {
    "the module guide": "modules.md",
    "what a model sees": "what-a-model-sees.md",
    "the API's page": "api.md",
}
"""Pages by how documents call them, followed by (`make docs`)."""
CALLED = re.compile(rf"({'|'.join(PAGES)}) \(`make docs`\)", re.IGNORECASE)
PICTURE = re.compile(r"^\*Picture \(`make docs`\): (.+)\.\*$", re.MULTILINE)


def on_files(files: Any, *, config: Any) -> Any:
    """Called by mkdocs with the files that it found."""
    made = {**module_guide(), **pictures(), "what-a-model-sees.md": _what_a_model_sees()}
    made["api.md"] = api_page()
    for path, text in made.items():
        files.append(File.generated(config, path, content=text))
    return files


def _what_a_model_sees() -> str:
    """Its sessions are played by the tests' support package."""
    if TESTS not in sys.path:
        sys.path.insert(0, TESTS)
    from support.documents.what_a_model_sees import page

    return page()


def on_page_markdown(markdown: str, *, page: Any, **_: object) -> str:
    """Called by mkdocs with each page."""

    def shown(words: re.Match[str]) -> str:
        if words[1] not in PICTURES:
            LOG.warning("%s shows %r, which is not drawn", page.file.src_uri, words[1])
        return f"![{words[1]}]({PICTURES.get(words[1], '')})"

    linked = CALLED.sub(lambda found: f"[{found[1]}]({PAGES[found[1].lower()]})", markdown)
    return PICTURE.sub(shown, linked)
