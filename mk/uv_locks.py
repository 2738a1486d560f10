"""Writes each adapter's uv.lock from its requirements.lock: uv_locks.py FOLDER...

It holds names and versions alone, without addresses or hashes: `uv sync` keeps these versions, adds
the rest from the package index that it is given, and writes that into the file.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

HEAD = """\
# Made by `make lock-uv` from requirements.lock, which has the hashes. `uv sync` keeps these
# versions, and completes this file with the addresses of the package index that it uses.
version = 1
requires-python = ">=3.11"
"""
REQUIREMENT = re.compile(
    r"^(?P<name>[a-z0-9._-]+)(\[[^]]*\])?==(?P<version>[^ ;]+)( ; (?P<marker>.+?))?( \\)?$",
    re.MULTILINE,
)
SOURCE = '{ registry = "https://index.invalid/simple" }'
"""No index has this name, so uv replaces it by the one that it uses."""


def uv_lock(requirements: str) -> str:
    """The uv.lock with the versions of a requirements.lock."""
    packages = []
    for found in REQUIREMENT.finditer(requirements):
        lines = [
            "[[package]]",
            f'name = "{found["name"]}"',
            f'version = "{found["version"]}"',
            f"source = {SOURCE}",
        ]
        if found["marker"]:
            lines.append(f"resolution-markers = [{json.dumps(found['marker'])}]")
        packages.append("\n".join(lines) + "\n")
    return "\n".join([HEAD, *packages])


def main() -> None:
    for folder in map(Path, sys.argv[1:]):
        requirements = (folder / "requirements.lock").read_text(encoding="utf-8")
        (folder / "uv.lock").write_text(uv_lock(requirements), encoding="utf-8")


if __name__ == "__main__":
    main()
