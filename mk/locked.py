"""Selection of a lock's entries for some roots: `locked.py LOCK ROOT... [--without NAME...]`.

Run at the top of the repository. A root is a folder of a package, a file of requirements, or a
distribution of the lock. The comments of uv in the lock contain the dependencies.
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

VIA = re.compile(r"^ +# via (.+)$", re.MULTILINE)


def select(lock: str, roots: Iterable[str], without: Iterable[str] = ()) -> str:
    """Return the entries of a lock that roots need, with their versions, markers and hashes.

    Args:
        lock: The lock's text.
        roots: Folders of packages, files of requirements, or distributions.
        without: Distributions to leave out, with dependencies that only they have.

    Raises:
        ValueError: A root is neither a package nor in the lock.
    """
    # Remove its head, and its list of omitted packages.
    lock = re.sub(r"^#.*\n", "", lock, flags=re.MULTILINE)
    entries = re.split(r"^(?=[a-z0-9._-]+==)", lock, flags=re.MULTILINE)[1:]
    users = {entry: _users_of(entry) for entry in entries}
    named = {entry: entry.partition("==")[0] for entry in entries}
    valid = {*named.values(), *(name for names in users.values() for name in names)}
    omitted, needed = set(without), set[str]()
    for root in roots:
        if Path(root, "pyproject.toml").is_file():
            needed |= _projects_of(root)
        elif root in valid:
            needed.add(root)
        else:
            raise ValueError(f"{root!r} is neither a package nor in the lock")
    while True:
        chosen = [
            entry
            for entry in entries
            if named[entry] not in omitted and (named[entry] in needed or users[entry] & needed)
        ]
        if {named[entry] for entry in chosen} <= needed:
            return "".join(chosen)
        needed |= {named[entry] for entry in chosen}


def _projects_of(folder: str) -> set[str]:
    """Return the project files of a package and of its siblings, as named in the lock."""
    siblings = {_project(path)["name"]: path for path in Path().glob("*/*/pyproject.toml")}
    projects: set[Path] = set()
    waiting = [Path(folder, "pyproject.toml")]
    while waiting:
        path = waiting.pop()
        if path not in projects:
            projects.add(path)
            needs = map(_requirement, _project(path).get("dependencies", ()))
            waiting += [siblings[name] for name in needs if name in siblings]
    return {path.as_posix() for path in projects}


def _project(path: Path) -> dict[str, Any]:
    return dict(tomllib.loads(path.read_text(encoding="utf-8"))["project"])


def _requirement(text: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", text, maxsplit=1)[0].lower()


def _users_of(entry: str) -> set[str]:
    match = VIA.search(entry)
    names = match[1].split(", ") if match else ()
    # "numpy", "-r requirements-dev.in" or "buildarena-geometry (libs/geometry/pyproject.toml)".
    return {re.sub(r"^-r |^.*\(|\)$", "", name) for name in names}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lock", type=Path)
    parser.add_argument("roots", nargs="+")
    parser.add_argument("--without", nargs="*", default=())
    options = parser.parse_args()
    print(select(options.lock.read_text(encoding="utf-8"), options.roots, options.without), end="")
