"""Readers of untrusted machine files, which are bounded before anything is built.

They are read in a separate process: two thousand blocks in one file take seconds, in which the API
answers others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from fastapi import Request

from buildarena_api.checking import Checker
from buildarena_api.http.problems import ErrorCode, ProblemError, invalid
from buildarena_backend.database.text import clean
from buildarena_backend.errors import UploadError
from buildarena_besiege import ImportedMachine, MachineFileError, read_machine_file
from buildarena_geometry import DocumentError, Machine
from buildarena_geometry.json_texts import TooDeepError, read_json
from buildarena_simulation.constants import MAX_PARTS

MAX_BYTES: Final = 2 << 20
"""Largest file; a machine of a hundred blocks has 60 kB with its log."""
SPARE_BYTES: Final = 512 << 20
"""Memory for one file: one of 2,000 blocks takes some 100 MB while it is read."""
LONGEST_S: Final = 20.0
"""Time for one file: 2,000 blocks take 2 s on an idle core."""
_BLANKS: Final = b" \t\r\n\x00\xef\xbb\xbf\xfe\xff"
_GLB: Final = b"glTF"


async def uploaded(request: Request) -> bytes:
    """Return the request's body, if its size is acceptable.

    Raises:
        ProblemError: It is empty or too large.
    """
    body = await request.body()
    if len(body) > MAX_BYTES:
        detail = f"a machine's file has at most {MAX_BYTES:,} bytes, this {len(body):,}"
        raise ProblemError(ErrorCode.TOO_LARGE, detail)
    return body


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """Content of a machine file.

    Attributes:
        content: The machine, and what it does not hold of the file.
        fault: Reason why the machine's document is unreadable; None if it can be tried.
    """

    content: ImportedMachine
    fault: str | None


@cache
def shared_checker() -> Checker[Upload]:
    """Return this process' checker; its child starts with the first file and ends with it."""
    return Checker("machine files", read_upload, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S)


def read_uploaded(data: bytes) -> Upload:
    """Return the machine of a file, whose type is recognized by content.

    Args:
        data: A machine document (JSON), or a machine file of the game (.bsg).

    Raises:
        ProblemError: It is none of these, is not sound, or can't be read within the bounds.
    """
    try:
        return shared_checker().ask(data)
    except UploadError as error:
        raise refused(str(error)) from error


def read_upload(data: bytes) -> Upload:
    """Return the machine of a file.

    Raises:
        UploadError: It contains none.
    """
    try:
        content = _content(data)
    except (DocumentError, MachineFileError) as error:
        raise UploadError(str(error)) from error
    return Upload(content=content, fault=_not_storable(content.machine))


def _content(data: bytes) -> ImportedMachine:
    if data.lstrip(_BLANKS).startswith(b"<"):
        return read_machine_file(data)
    return ImportedMachine(machine=Machine.from_document(_document(_json(data))))


def _not_storable(machine: Machine) -> str | None:
    try:
        Machine.from_document(machine.to_document())
    except DocumentError as error:
        return str(error)
    return None


def refused(message: str) -> ProblemError:
    """Return the answer to a file that is not a sound machine."""
    return invalid("file", message, code=ErrorCode.INVALID_FILE)


def _json(data: bytes) -> object:
    if data.startswith(_GLB):
        raise UploadError("a GLB file has shapes only: it can be looked at, not checked or tried")
    try:
        content: object = clean(read_json(data.decode("utf-8-sig")))
    except TooDeepError as error:
        raise UploadError(f"the file has {error}") from error
    except ValueError as error:
        raise UploadError(
            f"neither a machine document (JSON) nor a machine file of the game (.bsg): {error}"
        ) from error
    return content


def _document(content: object) -> dict[str, Any]:
    if not isinstance(content, dict) or "blocks" not in content:
        raise UploadError(
            "neither a machine document, a JSON object with blocks, joints and connectors, nor a "
            "machine file of the game (.bsg)"
        )
    count = _parts(content)
    if count > MAX_PARTS:
        raise UploadError(f"the document has {count:,} entries: at most {MAX_PARTS:,} are read")
    return content


def _parts(document: dict[str, Any]) -> int:
    """Return the number of entries of a document and of its sub-structures, of any kind."""
    lists = (document.get("blocks"), document.get("connectors"), document.get("control_sequence"))
    own = sum(len(items) for items in lists if isinstance(items, list))
    within = document.get("available")
    machines = within.values() if isinstance(within, dict) else ()
    return own + sum(_parts(machine) for machine in machines if isinstance(machine, dict))
