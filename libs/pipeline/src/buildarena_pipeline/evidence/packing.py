"""Writes evidence: one file, its members in a fixed order, without paths and names of people."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterable, Mapping
from typing import Final

from buildarena_pipeline.evidence.archive_names import (
    DOCUMENT,
    MAX_BYTES,
    MAX_MEMBER_BYTES,
    MAX_MEMBERS,
    MEMBER,
    PAGE,
)
from buildarena_pipeline.evidence.document import Evidence, EvidenceError, sentence_of
from buildarena_pipeline.evidence.page import page

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
_PATHS: Final = re.compile(
    r"""[A-Za-z]:[\\/][^"'<>|]*|\\\\[^"'<>|]*|(?<![\w.:/])~?/[^\s"'<>|,;]+"""
)
HIDDEN: Final = "(path)"


def without_paths(text: object, secrets: Iterable[str] = ()) -> str:
    """A text as a sentence in which no path of the machine stands, and none of the secrets.

    Args:
        text: What a step or an error said.
        secrets: Names and keys that must not stand in it either; short ones are left alone.
    """
    line = _PATHS.sub(HIDDEN, sentence_of(text))
    for secret in secrets:
        if len(secret) > 2:  # noqa: PLR2004 - shorter ones are parts of words
            line = re.sub(rf"(?<!\w){re.escape(secret)}(?!\w)", "(name)", line)
    return line


def write_evidence(evidence: Evidence, files: Mapping[str, bytes]) -> bytes:
    """The file: equal evidence has equal bytes.

    Args:
        evidence: What it says of itself.
        files: Logs, machine files and pictures, as ``steps/STEP/NAME``.

    Raises:
        EvidenceError: A file has another name, or something is too large.
    """
    wrong = next((name for name in files if not MEMBER.fullmatch(name)), None)
    if wrong is not None:
        raise EvidenceError(f"no file of a step is called {wrong[:100]!r}")
    large = next((name for name, data in files.items() if len(data) > MAX_MEMBER_BYTES), None)
    if large is not None:
        raise EvidenceError(f"{large} is larger than {MAX_MEMBER_BYTES:,} bytes")
    if len(files) + 2 > MAX_MEMBERS:
        raise EvidenceError(f"there are {len(files) + 2:,} files: at most {MAX_MEMBERS:,} are sent")
    document = json.dumps(evidence.model_dump(mode="json"), indent=1, sort_keys=True) + "\n"
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        _put(archive, DOCUMENT, document.encode())
        _put(archive, PAGE, page(evidence, files).encode())
        for name in sorted(files):
            _put(archive, name, files[name])
    if packed.tell() > MAX_BYTES:
        raise EvidenceError(f"it has {packed.tell():,} bytes: at most {MAX_BYTES:,} are sent")
    return packed.getvalue()


def _put(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    member = zipfile.ZipInfo(name, date_time=_EPOCH)
    member.compress_type = zipfile.ZIP_DEFLATED
    member.create_system = 3
    member.external_attr = 0o100644 << 16
    archive.writestr(member, data)
