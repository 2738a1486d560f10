"""Machine files of strangers: damaged at random, and made to do harm."""

import copy
import random
import re
from xml.etree import ElementTree as ET

BOMB = (
    b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9))
    + b"]><Machine>&j;</Machine>"
)
TRICKS = {
    "billion laughs": BOMB,
    "quadratic entity": b'<!DOCTYPE m [<!ENTITY a "'
    + b"x" * 100_000
    + b'">]><Machine>'
    + b"&a;" * 10_000
    + b"</Machine>",
    "external entity": b'<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><Machine>&x;</Machine>',
    "external document type": b'<!DOCTYPE m SYSTEM "http://127.0.0.1:9/x.dtd"><Machine/>',
    "parameter entity": b'<!DOCTYPE m [<!ENTITY % p SYSTEM "file:///etc/passwd"> %p;]><Machine/>',
    "document type alone": b"<!DOCTYPE Machine><Machine><Blocks/></Machine>",
    "deep": b"<Machine>" + b"<a>" * 200_000,
    "deep and closed": b"<Machine>" + b"<a>" * 1000 + b"</a>" * 1000 + b"</Machine>",
    "too large": b"<Machine>" + b" " * (8 * 1024 * 1024) + b"</Machine>",
    "too many blocks": b"<Machine><Blocks>" + b'<Block id="0"/>' * 2001 + b"</Blocks></Machine>",
    "no XML": b"\x00\x01\x02",
    "empty": b"",
    "cut off": b'<?xml version="1.0"?><Machine><Blo',
    "unknown encoding": b'<?xml version="1.0" encoding="klingon"?><Machine/>',
    "wrong encoding": b'<?xml version="1.0" encoding="utf-16"?><Machine/>',
    "another root": b"<Level/>",
}

TEXTS = ["", "nan", "inf", "-1e999", "1e309", "0", "-0.0", "99999999", "1_0", "٣", "0x10", "\ufeff"]
TEXTS += ["1,5", "True", "None", "UpArrow", "9" * 500, "😀", "&#65;", "StartingBlock", "\n", "7"]
_VALUE = re.compile(rb'"[^"<>]*"|>[^<>]*<')


def mutated(data: bytes, seed: int) -> bytes:
    """A file with a few things changed: bytes, values, numbers."""
    drawn = random.Random(seed)
    for _ in range(drawn.randint(1, 3)):
        data = drawn.choice((_bytes, *[_value] * 5, _brackets, _brackets))(data, drawn)
    return data


def _bytes(data: bytes, drawn: random.Random) -> bytes:
    found = bytearray(data)
    for _ in range(drawn.randint(1, 4)):
        if found:
            found[drawn.randrange(len(found))] = drawn.randrange(256)
    return bytes(found)


def _value(data: bytes, drawn: random.Random) -> bytes:
    places = list(_VALUE.finditer(data))
    if not places:
        return data
    place = drawn.choice(places)
    begin, end = place.group()[:1], place.group()[-1:]
    other = (
        drawn.choice(TEXTS).encode() if drawn.random() < 0.7 else drawn.choice(places).group()[1:-1]
    )
    return data[: place.start()] + begin + other + end + data[place.end() :]


def _brackets(data: bytes, drawn: random.Random) -> bytes:
    """Changes numbers in the script's own description of the machine."""
    start = data.find(b"buildarena machine ")
    if start < 0:
        return data
    end = data.find(b"\n", start)
    words = re.findall(rb"-?[0-9.e-]+|[A-Za-z_]+|.", data[start + 19 : end])
    for _ in range(drawn.randint(1, 3) if words else 0):
        words[drawn.randrange(len(words))] = drawn.choice(
            [b"1", b"-1", b"null", b"[]", b"{}", b'"A"', b"1e999", b"NaN", b"", b"{", b"true"]
        )
    return data[: start + 19] + b"".join(words) + data[end:]


TAGS = ["Boolean", "Single", "String", "StringArray", "Data", "Block", "Blocks", "Transform", "X"]
KEYS = ["flipped", "bmt-forward", "bmt-speed", "lua_data", "LUA", "buildarena.stored.lua", "", "k"]
NAMES = ["key", "id", "guid", "x", "w", "place", "name", "bsgVersion", "modId", "xml:space"]
VALUES = [*TEXTS, "T", "M3", "\t a \r\n b ", "]]>", "--[[", "]] os.exit()", "\u2028", "a" * 3000]


def rearranged(data: bytes, seed: int) -> bytes:
    """A file with a few elements, keys and values changed, that is still valid XML."""
    drawn = random.Random(seed)
    root = ET.fromstring(data)
    for _ in range(drawn.randint(1, 4)):
        element = drawn.choice(list(root.iter()))
        changes = (_tag, _attribute, _attribute, _text, _text, _child, _child, _child)
        drawn.choice(changes)(element, drawn)
    # A carriage return in a text stays one only as a reference.
    return ET.tostring(root, encoding="utf-8").replace(b"\r", b"&#13;")


def _tag(element: ET.Element, drawn: random.Random) -> None:
    element.tag = drawn.choice(TAGS)


def _attribute(element: ET.Element, drawn: random.Random) -> None:
    name = drawn.choice([*element.keys(), drawn.choice(NAMES)])
    if drawn.random() < 0.2:
        element.attrib.pop(name, None)
    else:
        element.set(name, drawn.choice(KEYS if name == "key" else VALUES))


def _text(element: ET.Element, drawn: random.Random) -> None:
    if drawn.random() < 0.8:
        element.text = drawn.choice(VALUES)
    else:
        element.tail = drawn.choice(VALUES)


def _child(element: ET.Element, drawn: random.Random) -> None:
    """Doubles, moves or removes one of an element's children."""
    if not len(element):
        return
    at = drawn.randrange(len(element))
    child = copy.deepcopy(element[at])
    if drawn.random() < 0.5:
        element.remove(element[at])
    if drawn.random() < 0.7:
        element.insert(drawn.randint(0, len(element)), child)
