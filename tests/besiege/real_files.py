"""Machine files as people's programs save them."""

import gzip
from pathlib import Path

DATA = Path(__file__).parents[1] / "data" / "besiege"
BSG = DATA / "bsg"
RICH = (DATA / "person.bsg").read_bytes()
"""A file with what public files of people and of mods hold."""


def stored_files() -> dict[str, bytes]:
    """The machine files at hand that others' programs saved."""
    packed = {file.stem: gzip.decompress(file.read_bytes()) for file in sorted(BSG.glob("*.gz"))}
    return packed | {file.name: file.read_bytes() for file in sorted(BSG.glob("*.bsg"))}
