"""Reads machines from files of any kind: the game's, documents, action logs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from msgspec import structs

from buildarena_besiege.importing.machine import ImportedMachine, read_machine_file
from buildarena_geometry import KeyPress
from buildarena_geometry.errors import DocumentError
from buildarena_geometry.json_texts import read_json
from buildarena_geometry.keys import KEYS
from buildarena_geometry.machine_files import machine_of
from buildarena_geometry.struct_reader import quote, read

_LEADING: Final = b" \t\r\n\x00"
_PUBLISHED_FIELDS: Final = {"time": "time_s", "hold_for": "hold_for_s"}
_XML_BEGINNINGS: Final = (b"<", b"\xef\xbb\xbf<", b"\xff\xfe<", b"\xfe\xff\x00<", b"\x00<")


def read_any_machine(data: bytes, *, where: str, dialect: str | None = None) -> ImportedMachine:
    """Return the machine of a file, whose format is recognised by content.

    Args:
        data: Machine file of the game (.bsg), or JSON: a machine document or an action log.
        where: Name of the file in messages.
        dialect: Version of the interface that recorded an action log. By default it is determined
            from the log.

    Raises:
        MachineFileError: It is XML, and not a machine file.
        DocumentError: It is neither, the document is invalid, or an action of the log is refused.
        ValueError: The dialect is unknown.
    """
    if data.lstrip(_LEADING).startswith(_XML_BEGINNINGS):
        return read_machine_file(data)
    return ImportedMachine(machine=machine_of(_json(data, where), where=where, version=dialect))


def read_presses(
    data: bytes, *, where: str, keys: Mapping[str, str] | None = None
) -> tuple[KeyPress, ...]:
    """Parse a control sequence from a JSON list.

    Args:
        data: Objects with time_s, key and hold_for_s; or with time, key and hold_for, as in the
            published files.
        where: Name of the file in messages.
        keys: Other names of keys, and the keys that they replace, as in `remap_keys`.

    Raises:
        DocumentError: It is not a control sequence; the message names the entry.
    """
    presses = []
    entries = read(_json(data, where), list[Any], where=where, error=DocumentError)
    for index, entry in enumerate(entries):
        place = f"{where}[{index}]"
        if isinstance(entry, dict) and "time" in entry:
            renamed = {_PUBLISHED_FIELDS.get(name, name): value for name, value in entry.items()}
            press = read(renamed, KeyPress, where=place, error=DocumentError)
        else:
            press = read(entry, KeyPress, where=place, error=DocumentError)
        named = keys or {}
        press = structs.replace(press, key=named.get(press.key, press.key))
        if press.key not in KEYS:
            expected = (
                f"one of {', '.join(dict.fromkeys([*named, *KEYS]))}, found {quote(press.key)}"
            )
            raise DocumentError(f"{place}.key: expected {expected}")
        presses.append(press)
    return tuple(presses)


def _json(data: bytes, where: str) -> object:
    try:
        content: object = read_json(data.decode("utf-8-sig"))
    except ValueError as error:
        raise DocumentError(f"{where}: not valid JSON: {error}") from error
    return content
