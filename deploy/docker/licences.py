"""Puts licence texts that must go along with their libraries into a folder: licences.py FOLDER.

Those of LGPL, MPL and GPL are meant, by what the libraries' metadata say. A library without its
text stops the build: the image could not be passed on.
"""

import re
import shutil
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

SITE = Path(sys.prefix, "lib", f"python3.{sys.version_info[1]}", "site-packages")
COMMON = Path("/usr/share/common-licenses")
"""Debian's copies of the texts that others refer to."""
COPYLEFT = re.compile(r"\b(A?L?GPL|MPL|EPL)|Mozilla Public License|GNU (Lesser |Affero )?General")
TEXT = re.compile(r"licen[cs]e|copying|notice", re.IGNORECASE)


def licence_of(found: Distribution) -> str:
    """What its metadata call its licence, in one line."""
    said = found.metadata
    classifiers = [
        line for line in said.get_all("Classifier") or [] if line.startswith("License ::")
    ]
    named = (said.get("License") or "").strip().partition("\n")[0]
    return ", ".join(filter(None, [said.get("License-Expression"), named, *classifiers]))


def texts_of(found: Distribution) -> list[Path]:
    """The licence texts among its metadata."""
    files = [Path(str(found.locate_file(file))) for file in found.files or []]
    return [
        path
        for path in files
        if ".dist-info" in str(path.parent) and TEXT.search(path.name) and path.is_file()
    ]


def gathered(site: Path, folder: Path) -> dict[str, list[Path]]:
    """Copies the texts, a folder for each library.

    Args:
        site: Where libraries are installed.
        folder: Where the texts go.

    Returns:
        The copies by the library's name.

    Raises:
        SystemExit: A library has no text.
    """
    copies = {}
    for found in sorted(distributions(path=[str(site)]), key=lambda one: one.name):
        licence = licence_of(found)
        if not COPYLEFT.search(licence):
            continue
        texts = texts_of(found)
        if not texts:
            sys.exit(f"{found.name}: the text of its licence is not there ({licence})")
        if "LGPL" in licence or "Lesser" in licence:
            texts.append(COMMON / "GPL-3")  # version 3 of the LGPL is terms on top of this one
        place = folder / found.name
        place.mkdir(parents=True, exist_ok=True)
        copies[found.name] = [Path(shutil.copyfile(text, place / text.name)) for text in texts]
    return copies


if __name__ == "__main__":
    gathered(SITE, Path(sys.argv[1]))
