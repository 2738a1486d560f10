"""What a machine file says, read by nothing of ours, and what of it a second file lacks."""

import json
import math
from collections import Counter
from xml.etree import ElementTree as ET

from buildarena_besiege import MachineFileError, plain_machine_file, read_machine_file
from buildarena_geometry import DocumentError, Machine

STORED = "buildarena.stored."
OURS = "buildarena machine "


def said(element: ET.Element, *, without: tuple[str, ...] = ()) -> tuple:
    """An element as a value: attributes and texts as they are, blanks between elements left out."""
    attributes = tuple(sorted((k, v) for k, v in element.items() if k not in without))
    inner = tuple((said(child), (child.tail or "").strip()) for child in element)
    text = (element.text or "").strip() if len(element) else element.text or ""
    return element.tag, attributes, text, inner


def entries(root: ET.Element) -> list[ET.Element]:
    return [entry for data in root.findall("Data") for entry in data]


def of_script(entry: ET.Element) -> bool:
    return entry.get("key", "").strip().lower().startswith("lua")


def is_ours(root: ET.Element) -> bool:
    return any(e.get("key") == "lua_data" and OURS in (e.text or "")[:300] for e in entries(root))


def machine_data(root: ET.Element, *, scripted: bool) -> list[tuple]:
    """The machine's own data, with its script or without."""
    own = [entry for entry in entries(root) if scripted or not of_script(entry)]
    for entry in own:
        if entry.get("key", "").startswith(STORED):
            entry.set("key", entry.get("key").removeprefix(STORED))
    return [said(entry) for entry in own]


def blocks(root: ET.Element) -> list[ET.Element]:
    return [block for room in root.findall("Blocks") for block in room]


def without_trials_key(root: ET.Element) -> None:
    """Takes out what a trial of ours, whose cannons are held, adds to their keys."""
    for block in blocks(root):
        for entry in entries(block):
            held = [child for child in entry if child.text == "Alpha1"]
            for child in held:
                entry.remove(child)
            if held and not len(entry):
                entry.text = None


def lost(before: bytes, after: bytes) -> list[str]:
    """What the first file says and the second does not."""
    old, new = ET.fromstring(before), ET.fromstring(after)
    if is_ours(old) and b"&quot;plain&quot;:true" not in before and b'"plain":true' not in before:
        without_trials_key(old)
        without_trials_key(new)
    missing = []
    if said(old, without=("name",))[1] != said(new, without=("name",))[1]:
        missing.append("the machine's attributes")
    # A script of ours is written anew; one of ours that is damaged counts as a stranger's.
    names = [[entry.get("key") for entry in entries(root)] for root in (old, new)]
    stored = f"{STORED}lua_data" in names[1] and f"{STORED}lua_data" not in names[0]
    data = machine_data(old, scripted=stored or not is_ours(old))
    if data != machine_data(new, scripted=False):
        missing.append("the machine's data")
    others = [said(part) for part in old if part.tag not in {"Data", "Blocks"}]
    theirs = Counter(said(part) for part in new if part.tag not in {"Data", "Blocks"})
    missing += [f"the element {other[0]}" for other in others if not theirs[other]]
    if len(blocks(old)) != len(blocks(new)):
        missing.append("blocks")
    used: set[str] = set()
    for number, (one, other) in enumerate(zip(blocks(old), blocks(new), strict=False), 1):
        guid = one.get("guid", "").lower()
        without = ("guid",) if not guid or guid in used or guid != other.get("guid").lower() else ()
        used.add(guid)
        if said(one, without=without) != said(other, without=without):
            missing.append(f"block {number}")
    return missing


def lost_of_ours(before: bytes, after: bytes) -> list[str]:
    """As `lost`, for a file of ours that nobody has added to: values may be written otherwise."""
    old, new = ET.fromstring(before), ET.fromstring(after)
    cargo = [block for block in blocks(old) if block.get("id") == "35"]
    mine = [block for block in blocks(old) if block not in cargo]
    missing = [] if len(mine) == len(blocks(new)) else ["blocks"]
    for number, (one, other) in enumerate(zip(mine, blocks(new), strict=False), 1):
        pairs = zip(entries(one), entries(other), strict=False)
        if len(entries(one)) != len(entries(other)) or not all(alike(*pair) for pair in pairs):
            missing.append(f"block {number}")
    return missing


def alike(left: ET.Element, right: ET.Element) -> bool:
    if left.get("key") == right.get("key") == "bmt-lua_ref_key":
        return True
    if (left.tag, left.attrib) != (right.tag, right.attrib):
        return False
    texts, others = [child.text for child in left], [child.text for child in right]
    if texts and texts[-1] == "Alpha1" and texts[:-1] == others:  # the trial's own key
        return True
    pairs = zip([left.text, *texts], [right.text, *others], strict=True)
    return len(texts) == len(others) and all(same(a or "", b or "") for a, b in pairs)


def same(left: str, right: str) -> bool:
    try:
        return math.isclose(float(left), float(right), rel_tol=1e-4, abs_tol=1e-4)
    except ValueError:
        return left.strip().lower() == right.strip().lower()


def round_trip(data: bytes) -> bool:
    """Whether a file is refused as one, or read and written again without a loss."""
    try:
        first = read_machine_file(data)
    except MachineFileError:
        return False
    document = json.loads(json.dumps(first.machine.to_document()))
    try:
        assert Machine.from_document(document) == first.machine
    except DocumentError:
        assert any("would not be read back" in remark for remark in first.not_understood)
    assert isinstance(first.file_data, tuple)
    file = plain_machine_file(first.machine, name="m")
    second = read_machine_file(file)
    assert json.loads(json.dumps(second.machine.to_document())) == document
    if first.machine.state.file_data:
        missing = lost(data, file)
        assert plain_machine_file(second.machine, name="m") == file
    else:
        missing = lost_of_ours(data, file)
    assert not missing, missing
    return True
