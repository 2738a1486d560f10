"""Takes files with a dot before their names out of sdists: plain_sdists.py SDIST...

Hatch puts the repository's .gitignore into each, and has no option against it.
"""

from __future__ import annotations

import gzip
import io
import sys
import tarfile
from pathlib import Path

for sdist in map(Path, sys.argv[1:]):
    written = io.BytesIO()
    # The archive has no time of its own, so the same input gives the same bytes.
    with tarfile.open(sdist) as whole:
        members = [m for m in whole if not any(p.startswith(".") for p in m.name.split("/"))]
        with (
            gzip.GzipFile(fileobj=written, mode="wb", mtime=members[0].mtime) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as plain,
        ):
            for member in members:
                plain.addfile(member, whole.extractfile(member) if member.isfile() else None)
    sdist.write_bytes(written.getvalue())
