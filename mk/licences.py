"""Prints the licences and pins of everything that we depend on: licences.py [--json].

Pins are the locks'; licences are what installed metadata say, in SPDX's words. The exit code is 1
where something installed says none, or one that is not understood.
"""

from __future__ import annotations

import json
import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from license_expression import ExpressionError, get_license_index, get_spdx_licensing

ROOT = Path(__file__).parents[1]
PIN = re.compile(r"^(?P<name>[A-Za-z0-9._-]+)(\[[^]]*\])?==(?P<version>[^ ;\\]+)", re.MULTILINE)
LOCKS = {
    "product and tools": "requirements.lock",
    **{
        f"adapter {lock.parent.name}": str(lock.relative_to(ROOT))
        for lock in sorted(ROOT.glob("integrations/*/requirements.lock"))
    },
}
PAGES = "clients/web/package-lock.json"
ENVIRONMENTS = (".venv", ".venv-integrations/*")
NOT_HERE, UNKNOWN = "not installed here", "unknown"
SPDX = get_spdx_licensing()
CATEGORIES: Mapping[str, str] = {
    key: entry["category"]
    for entry in get_license_index()
    for key in (entry.get("spdx_license_key"), *entry.get("other_spdx_license_keys", ()))
    if key
}
# How packages spell licences, beside SPDX's own words.
SPELLED = {
    "3-clause bsd license": "BSD-3-Clause",
    "apache": "Apache-2.0",
    "apache 2": "Apache-2.0",
    "apache 2.0": "Apache-2.0",
    "apache 2.0 license": "Apache-2.0",
    "apache license": "Apache-2.0",
    "apache license 2.0": "Apache-2.0",
    "apache license, version 2.0": "Apache-2.0",
    "apache software license": "Apache-2.0",
    "bsd": "BSD-3-Clause",
    "bsd 2-clause license": "BSD-2-Clause",
    "bsd 3-clause license": "BSD-3-Clause",
    "bsd license": "BSD-3-Clause",
    "gnu general public license v3 or later (gplv3+)": "GPL-3.0-or-later",
    "gnu lesser general public license v2 or later (lgplv2+)": "LGPL-2.0-or-later",
    "gnu lesser general public license v3 (lgplv3)": "LGPL-3.0-only",
    "gplv2": "GPL-2.0-only",
    "isc license": "ISC",
    "isc license (iscl)": "ISC",
    "mit license": "MIT",
    "mit style": "MIT",
    "mozilla public license 2.0 (mpl 2.0)": "MPL-2.0",
    "new bsd": "BSD-3-Clause",
    "psfl": "PSF-2.0",
    "python software foundation license": "PSF-2.0",
    "the unlicense (unlicense)": "Unlicense",
    "zlib/libpng license": "Zlib",
}
# What no metadata say: a part of protobuf-py, a misspelt LICENCE file, the end of a README.
READ_BY_HAND = {
    "protobuf-py-ext": "Apache-2.0",
    "prime-pydantic-config": "Apache-2.0",
    "webgl-constants": "MIT",
}


@dataclass(frozen=True, slots=True, order=True)
class Part:
    """A package at a version.

    Attributes:
        name: Its name, as the lock has it.
        version: Its pin.
        licence: SPDX expression, or why there is none.
        kind: The strictest category of the expression's licences, such as `Permissive`.
        of: What needs it.
    """

    name: str
    version: str
    licence: str
    kind: str
    of: tuple[str, ...]


def parts(root: Path = ROOT) -> list[Part]:
    """All parts by name and version: Python's from the locks, those of the pages from theirs."""
    known = dict(installed(root))
    of: dict[tuple[str, str], list[str]] = defaultdict(list)
    for needed, lock in LOCKS.items():
        for found in PIN.finditer((root / lock).read_text()):
            of[normal(found["name"]), found["version"]].append(needed)
    python = [
        made(name, version, known.get((name, version), known.get((name, ""), NOT_HERE)), needed)
        for (name, version), needed in of.items()
    ]
    return sorted([*python, *of_pages(json.loads((root / PAGES).read_text()))])


def installed(root: Path) -> Iterator[tuple[tuple[str, str], str]]:
    """Licences by name and version of what is installed; by name alone for other versions."""
    for pattern in ENVIRONMENTS:
        for site in sorted(root.glob(f"{pattern}/lib/python3.*/site-packages")):
            for found in distributions(path=[str(site)]):
                yield (normal(found.name), found.version), licence_of(found)
                yield (normal(found.name), ""), licence_of(found)


def licence_of(found: Distribution) -> str:
    """A distribution's licence as an SPDX expression; `UNKNOWN` where nothing in it says one."""
    said = found.metadata
    named = said.get("License") or ""
    classifiers = [
        line.rpartition(" :: ")[2]
        for line in said.get_all("Classifier") or []
        if line.startswith("License :: OSI Approved :: ")
    ]
    asked = [said.get("License-Expression") or "", named, " OR ".join(map(spdx, classifiers))]
    # Some write the whole text where a name belongs, or have no more than the text.
    asked += [title(named), *(title(path.read_text()) for path in texts_of(found))]
    return next((spdx(text) for text in asked if spdx(text) != UNKNOWN), UNKNOWN)


def title(text: str) -> str:
    """The first line of a licence's text, which names it in most."""
    return text.strip().partition("\n")[0].partition(" - ")[0]


def texts_of(found: Distribution) -> list[Path]:
    """The licence texts of a distribution."""
    files = [Path(str(found.locate_file(file))) for file in found.files or []]
    return [path for path in files if path.parent.name == "licenses" and path.is_file()]


def spdx(text: str) -> str:
    """A licence in SPDX's words; `UNKNOWN` where they have none for it."""
    text = SPELLED.get(text.strip().lower(), text.strip())
    try:
        told = SPDX.parse(text, validate=True)
    except ExpressionError:
        return UNKNOWN
    return UNKNOWN if told is None else str(told)


def of_pages(lock: Mapping[str, Any]) -> Iterator[Part]:
    """What the dashboard is built with, by its lock, which says licences itself."""
    for place, entry in lock["packages"].items():
        name = place.rpartition("node_modules/")[2]
        if name and not entry.get("link"):
            needed = "pages' build" if entry.get("dev") else "pages"
            yield made(name, entry["version"], spdx(str(entry.get("license", ""))), [needed])


def made(name: str, version: str, licence: str, needed: Iterable[str]) -> Part:
    if licence == UNKNOWN:
        licence = READ_BY_HAND.get(name, UNKNOWN)
    keys = () if licence in {UNKNOWN, NOT_HERE} else SPDX.license_keys(licence)
    kinds = [CATEGORIES.get(key, "") for key in keys]
    strict = [kind for kind in kinds if kind.startswith("Copyleft")]
    kind = max(strict, default=next(iter(kinds), ""), key=lambda found: found == "Copyleft")
    return Part(name, version, licence, kind, tuple(dict.fromkeys(needed)))


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def table(found: Iterable[Part]) -> str:
    """A Markdown table."""
    rows = [
        f"| {part.name} | {part.version} | {part.licence} | {part.kind} | {', '.join(part.of)} |"
        for part in found
    ]
    head = "| package | version | licence | kind | of |\n|---|---|---|---|---|"
    return "\n".join([head, *rows])


def main() -> int:
    found = parts()
    if "--json" in sys.argv[1:]:
        print(json.dumps([asdict(part) for part in found], indent=2))
    else:
        print(table(found))
    unclear = [f"{part.name} {part.version}" for part in found if part.licence == UNKNOWN]
    if unclear:
        print(f"The licence is not known of: {', '.join(unclear)}", file=sys.stderr)
    return 1 if unclear else 0


if __name__ == "__main__":
    sys.exit(main())
