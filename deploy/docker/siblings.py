"""Prints one of our distributions and all of ours that it needs, as their wheels say."""

import re
import sys
import zipfile
from pathlib import Path

WHEELS = Path("/mnt/wheels")


def needs(name: str) -> list[str]:
    """The distributions of ours that one needs at once; those of extras are left out."""
    wheel = next(WHEELS.glob(f"{name.replace('-', '_')}-*.whl"))
    with zipfile.ZipFile(wheel) as archive:
        metadata = next(n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        text = archive.read(metadata).decode()
    return re.findall(r"^Requires-Dist: (buildarena-[a-z-]+)==[^;\s]+$", text, re.MULTILINE)


found = [sys.argv[1]]
for each in found:
    found.extend(name for name in needs(each) if name not in found)
print(*found, sep="\n")
