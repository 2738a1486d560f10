"""Reads machines that strangers hand over as files: bounded before anything is built."""

from __future__ import annotations

from typing import Any, Final

from fastapi import Request

from buildarena_api.http.problems import ProblemError
from buildarena_benchmark import ValidationIssue
from buildarena_besiege import ImportedMachine, MachineFileError, read_machine_file
from buildarena_geometry import DocumentError, Machine
from buildarena_geometry.json_texts import TooDeepError, read_json
from buildarena_simulation.constants import MAX_PARTS

MAX_BYTES: Final = 2 << 20
"""Largest file; a machine of a hundred blocks has 60 kB with its log."""
_BLANKS: Final = b" \t\r\n\x00\xef\xbb\xbf\xfe\xff"
_GLB: Final = b"glTF"


async def uploaded(request: Request) -> bytes:
    """The request's body, as long as it is of an acceptable size.

    Raises:
        ProblemError: It is empty or too large.
    """
    body = await request.body()
    if len(body) > MAX_BYTES:
        detail = f"a machine's file has at most {MAX_BYTES:,} bytes, this {len(body):,}"
        raise ProblemError(413, detail)
    return body


def read_upload(data: bytes) -> ImportedMachine:
    """The machine of a file, told apart by content.

    Args:
        data: A machine document (JSON) or a machine file of the game (.bsg).

    Raises:
        ProblemError: It is neither, or is not sound.
    """
    try:
        if data.lstrip(_BLANKS).startswith(b"<"):
            return read_machine_file(data)
        machine = Machine.from_document(_document(data))
    except (DocumentError, MachineFileError) as error:
        raise refused(str(error)) from error
    return ImportedMachine(machine=machine, name="", not_understood=())


def not_storable(machine: Machine) -> str | None:
    """Why a machine's document would not be read back; None for one that can be tried."""
    try:
        Machine.from_document(machine.to_document())
    except DocumentError as error:
        return str(error)
    return None


def refused(message: str) -> ProblemError:
    """The answer to a file that is not a sound machine."""
    return ProblemError(422, message, errors=[ValidationIssue(path="file", message=message)])


def _document(data: bytes) -> object:
    if data.startswith(_GLB):
        raise refused("a GLB file has shapes only: it can be looked at, not checked or tried")
    try:
        content: object = read_json(data.decode("utf-8-sig"))
    except TooDeepError as error:
        raise refused(f"the file has {error}") from error
    except ValueError as error:
        raise refused(
            f"neither a machine document (JSON) nor a machine file of the game (.bsg): {error}"
        ) from error
    if not isinstance(content, dict) or "blocks" not in content:
        raise refused("not a machine document: a JSON object with blocks, joints and connectors")
    count = _parts(content)
    if count > MAX_PARTS:
        raise refused(f"the document has {count:,} entries: at most {MAX_PARTS:,} are read")
    return content


def _parts(document: dict[str, Any]) -> int:
    """Entries of a document and of the machines it has within, whatever they are."""
    lists = (document.get("blocks"), document.get("connectors"), document.get("control_sequence"))
    own = sum(len(found) for found in lists if isinstance(found, list))
    within = document.get("available")
    machines = within.values() if isinstance(within, dict) else ()
    return own + sum(_parts(one) for one in machines if isinstance(one, dict))
