"""The built pages, and their first page as a static site needs it."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from buildarena_cli.errors import CommandError

INDEX: Final = "index.html"
SITE: Final = "site.json"
COMPRESSED: Final = (".br", ".gz")
"""Copies for the service; file servers compress by themselves."""
POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'"
)
"""The service's, as far as a page can state it by itself."""
_HEAD: Final = f"""<head>
    <meta charset="utf-8" />
    <meta http-equiv="Content-Security-Policy" content="{POLICY}" />
    <meta name="buildarena-site" content="{SITE}" />
    <meta name="referrer" content="no-referrer" />"""
_BEGIN: Final = re.compile(r'<head>\s*<meta charset="utf-8" */?>')
_ADDRESS: Final = re.compile(r'\b(src|href)="/(?!/)')
_WITHOUT_SCRIPT: Final = re.compile(r"<noscript>.*?</noscript>", re.DOTALL)


def built_pages() -> Path:
    """The folder of the built pages, which the API's package carries.

    Raises:
        CommandError: They were not built.
    """
    package = find_spec("buildarena_api")
    for place in (package.submodule_search_locations or ()) if package else ():
        folder = Path(place, "pages")
        if (folder / INDEX).is_file():
            return folder
    raise CommandError("the dashboard's pages have not been built: `make web` builds them")


def page_files(folder: Path) -> list[Path]:
    """The files of the built pages besides the first page, relative to their folder."""
    return [
        file.relative_to(folder)
        for file in sorted(folder.rglob("*"))
        if file.is_file()
        and not file.name.startswith(".")
        and file.suffix not in COMPRESSED
        and file != folder / INDEX
    ]


def first_page(folder: Path) -> str:
    """The first page of a site: it finds its files beside itself, and reads stored answers.

    Args:
        folder: The folder of the built pages.

    Raises:
        CommandError: The built page is not as expected: pages and program are of two versions.
    """
    text, heads = _BEGIN.subn(
        lambda _: _HEAD, (folder / INDEX).read_text(encoding="utf-8"), count=1
    )
    text, addresses = _ADDRESS.subn(r'\1="./', text)
    if not (heads and addresses):
        raise CommandError(f"{folder / INDEX} is of another version: `make web` builds it again")
    return _WITHOUT_SCRIPT.sub("<noscript>This site needs JavaScript.</noscript>", text)
