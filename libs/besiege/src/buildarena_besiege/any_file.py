"""Reads machines from files of any kind: the game's, machine documents, action logs."""

from __future__ import annotations

from typing import Final

from buildarena_besiege.importing.machine import ImportedMachine, read_machine_file
from buildarena_geometry import KeyPress
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.keys import KEYS
from buildarena_geometry.machine_files import machine_of
from buildarena_geometry.reading import Reader

_LEADING: Final = b" \t\r\n\x00"
_XML_BEGINNINGS: Final = (b"<", b"\xef\xbb\xbf<", b"\xff\xfe<", b"\xfe\xff\x00<", b"\x00<")


def read_any_machine(data: bytes, *, where: str) -> ImportedMachine:
    """The machine of a file, told apart by content.

    Args:
        data: A machine file of the game's (.bsg), a machine document or an action log (JSON).
        where: What messages call the file.

    Raises:
        MachineFileError: It is XML, and not a machine file.
        DocumentError: It is neither, or the document is wrong.
    """
    if data.lstrip(_LEADING).startswith(_XML_BEGINNINGS):
        return read_machine_file(data)
    machine = machine_of(_json(data, where), where=where)
    return ImportedMachine(machine=machine, name="", not_understood=())


def read_presses(data: bytes, *, where: str) -> tuple[KeyPress, ...]:
    """A control sequence from a JSON list.

    Args:
        data: Objects with time_s, key and hold_for_s; or with time, key and hold_for, as the
            published files call them.
        where: What messages call the file.

    Raises:
        DocumentError: It is none; the message names the entry.
    """
    found = []
    for entry in Reader(value=_json(data, where), where=where, error=DocumentError).items():
        published = isinstance(entry.value, dict) and "time" in entry.value
        time, hold = ("time", "hold_for") if published else ("time_s", "hold_for_s")
        fields = entry.fields(required=(time, "key", hold))
        found.append(
            KeyPress(
                time_s=fields[time].number(least=0),
                key=fields["key"].choice(KEYS),
                hold_for_s=fields[hold].number(above=0),
            )
        )
    return tuple(found)


def _json(data: bytes, where: str) -> object:
    try:
        content: object = read_json(data.decode("utf-8-sig"))
    except ValueError as error:
        raise DocumentError(f"{where}: not valid JSON: {error}") from error
    return content
