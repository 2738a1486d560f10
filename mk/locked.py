"""Prints the part of a lock that something needs: `locked.py LOCK ROOT... [--without NAME...]`.

Run at the top of the repository. A root is a package of ours (its folder), a file of requirements,
or a distribution of the lock. Who asks for what stands in the lock, in the comments that uv writes.
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

VIA = re.compile(r"^ +# via (.+)$", re.MULTILINE)


def selected(lock: str, roots: Iterable[str], without: Iterable[str] = ()) -> str:
    """The entries of a lock that roots need, with their versions, markers and hashes.

    Args:
        lock: The lock's text.
        roots: Folders of packages, files of requirements, or distributions.
        without: Distributions to leave out, with what only they need.

    Raises:
        ValueError: A root is no package, nothing in the lock is there for it, and it is not in it.
    """
    # Its head, and its list of what was left out of it.
    lock = re.sub(r"^#.*\n", "", lock, flags=re.MULTILINE)
    entries = re.split(r"^(?=[a-z0-9._-]+==)", lock, flags=re.MULTILINE)[1:]
    asked = {entry: _asked_by(entry) for entry in entries}
    named = {entry: entry.partition("==")[0] for entry in entries}
    known = {*named.values(), *(name for names in asked.values() for name in names)}
    left, found = set(without), set[str]()
    for root in roots:
        if Path(root, "pyproject.toml").is_file():
            found |= _projects_of(root)
        elif root in known:
            found.add(root)
        else:
            raise ValueError(f"nothing in the lock is there for {root!r}")
    while True:
        chosen = [
            entry
            for entry in entries
            if named[entry] not in left and (named[entry] in found or asked[entry] & found)
        ]
        if {named[entry] for entry in chosen} <= found:
            return "".join(chosen)
        found |= {named[entry] for entry in chosen}


def _projects_of(folder: str) -> set[str]:
    """Project files of a package of ours and of its siblings, as they stand in the lock."""
    siblings = {_project(path)["name"]: path for path in Path().glob("*/*/pyproject.toml")}
    found: set[Path] = set()
    waiting = [Path(folder, "pyproject.toml")]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            needs = map(_requirement, _project(path).get("dependencies", ()))
            waiting += [siblings[name] for name in needs if name in siblings]
    return {path.as_posix() for path in found}


def _project(path: Path) -> dict[str, Any]:
    return dict(tomllib.loads(path.read_text(encoding="utf-8"))["project"])


def _requirement(text: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", text, maxsplit=1)[0].lower()


def _asked_by(entry: str) -> set[str]:
    match = VIA.search(entry)
    names = match[1].split(", ") if match else ()
    # "numpy", "-r requirements-dev.in" or "buildarena-geometry (libs/geometry/pyproject.toml)".
    return {re.sub(r"^-r |^.*\(|\)$", "", name) for name in names}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lock", type=Path)
    parser.add_argument("roots", nargs="+")
    parser.add_argument("--without", nargs="*", default=())
    given = parser.parse_args()
    print(selected(given.lock.read_text(encoding="utf-8"), given.roots, given.without), end="")
