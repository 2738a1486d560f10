"""Machine files as people's programs save them."""

import zipfile
from functools import cache
from pathlib import Path

DATA = Path(__file__).parents[1] / "data" / "besiege"
RICH = (DATA / "person.bsg").read_bytes()
"""A file with what public files of people and of mods hold."""


@cache
def published_files() -> dict[str, bytes]:
    """Exports of the published library by their names, without an ending."""
    with zipfile.ZipFile(DATA / "bsg.zip") as archive:
        return {name.removesuffix(".bsg"): archive.read(name) for name in archive.namelist()}
