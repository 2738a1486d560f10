"""How the game writes a machine that it has loaded: its own settings beside those of the file."""

import re
from typing import Final
from xml.etree import ElementTree as ET

OWN: Final = {"2": ("Single", "bmt-speed", "1"), "15": ("Boolean", "bmt-burnt", "False")}
"""Entries that the game adds, by the type of block."""
_WHOLE: Final = re.compile(r"(-?\d+)\.0+")


def saved_file(data: bytes, name: str) -> bytes:
    """What the game saves of a machine file that it loaded."""
    root = ET.fromstring(data)
    root.set("name", name)
    for block in root.iter("Block"):
        data_of = block.find("Data")
        if data_of is None:
            continue
        for entry in data_of:
            if entry.tag == "Single" and (whole := _WHOLE.fullmatch(entry.text or "")):
                entry.text = whole[1]
        own = OWN.get(block.get("id", ""))
        if own is not None and all(entry.get("key") != own[1] for entry in data_of):
            ET.SubElement(data_of, own[0], {"key": own[1]}).text = own[2]
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root)
