"""Makes what a layer added to /opt/buildarena smaller: shrink.py SECONDS, when the layer began.

What trimmed.txt names goes, symbols that only debuggers read too, and equal files become one.
"""

import hashlib
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

SITE = Path(sys.prefix, "lib", f"python3.{sys.version_info[1]}", "site-packages")
MOUNTED = Path("/mnt")
LARGE = 100_000
LOADED = 1
"""The kind of a program header whose segment is mapped into memory."""


def is_aligned(path: Path) -> bool:
    """Whether a library can be mapped: strip misplaces segments of some that auditwheel has moved."""
    data = path.read_bytes()
    start, (size, count) = (
        struct.unpack_from("<Q", data, 32)[0],
        struct.unpack_from("<HH", data, 54),
    )
    for i in range(count):
        kind, _, offset, address, *_, align = struct.unpack_from(
            "<IIQQQQQQ", data, start + i * size
        )
        if kind == LOADED and align and (offset - address) % align:
            return False
    return True


def strip(path: Path) -> None:
    smaller = path.with_name(f"{path.name}.smaller")
    libraries = next(MOUNTED.glob("usr/lib/*-linux-gnu"))
    subprocess.run(
        [MOUNTED / "usr/bin/strip", "--strip-unneeded", "-o", smaller, path],
        env={"LD_LIBRARY_PATH": str(libraries)},
        check=True,
    )
    if is_aligned(smaller):
        shutil.copymode(path, smaller)
        smaller.replace(path)
    else:
        smaller.unlink()


for line in (MOUNTED / "recipe/trimmed.txt").read_text().splitlines():
    if line.startswith("#"):
        continue
    for path in sorted(SITE.glob(line)):
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
began = float(sys.argv[1])
added = [
    p for p in SITE.rglob("*") if p.is_file() and not p.is_symlink() and p.stat().st_ctime >= began
]
for path in added:
    if ".so" in path.suffixes and path.read_bytes()[:5] == b"\x7fELF\x02":
        strip(path)
first: dict[str, Path] = {}
for path in added:
    if path.stat().st_size >= LARGE:
        kept = first.setdefault(hashlib.sha256(path.read_bytes()).hexdigest(), path)
        if kept != path:
            path.unlink()
            os.link(kept, path)
