"""Removal of hidden files from sdists: plain_sdists.py SDIST...

Hatch adds the repository's .gitignore to each, without an option to prevent it.
"""

from __future__ import annotations

import gzip
import io
import sys
import tarfile
from pathlib import Path

for sdist in map(Path, sys.argv[1:]):
    written = io.BytesIO()
    # The archive contains no current time, so the same input gives the same bytes.
    with tarfile.open(sdist) as archive:
        members = [m for m in archive if not any(p.startswith(".") for p in m.name.split("/"))]
        with (
            gzip.GzipFile(fileobj=written, mode="wb", mtime=members[0].mtime) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as plain,
        ):
            for member in members:
                plain.addfile(member, archive.extractfile(member) if member.isfile() else None)
    sdist.write_bytes(written.getvalue())
