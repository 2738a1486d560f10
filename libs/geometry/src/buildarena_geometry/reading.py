"""Reads JSON values that people wrote into typed structs; errors name the place."""

from __future__ import annotations

import re
import sys
import threading
from typing import TYPE_CHECKING, Annotated, NoReturn, TypeVar

import msgspec
from msgspec import Meta, inspect

if TYPE_CHECKING:
    from buildarena_geometry.errors import GeometryError

_LARGEST = sys.float_info.max
_LONGEST_QUOTE = 60  # characters; one line of a terminal
Finite = Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)]
Amount = Annotated[float, Meta(ge=0.0, le=_LARGEST)]
Positive = Annotated[float, Meta(gt=0.0, le=_LARGEST)]
Point = tuple[Finite, Finite, Finite]
Name = Annotated[str, Meta(max_length=60)]

_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "an object",
}
_BOUNDS = {
    r" > ([\d.e+]+)": r" above \1",
    r" of length <= (\d+)": r" of at most \1 characters",
    r" >= ([\d.e+]+)": r" of at least \1",
    r" <= ([\d.e+]+)": r" of at most \1",
    r"(\d)\.0$": r"\1",
}
_STEP = re.compile(r"\.(\w+)|\[(\d+|\.\.\.)\]")
_Read = TypeVar("_Read")
_FIRST = threading.Lock()
"""msgspec lays a struct's form out when it is first read; two threads at once crash there."""
_laid_out: set[object] = set()


class Whole(int):
    """A whole number that is not negative, as JSON spells it: 2.0 is as whole as 2."""


class Form(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of a file: its fields are those of the struct, and there are no others."""


class MisfitError(ValueError):
    """A field that is good by itself does not fit the others; the text begins with its place."""


def read(value: object, kind: type[_Read], *, where: str, error: type[GeometryError]) -> _Read:
    """A JSON value as a struct.

    Args:
        value: JSON as Python has it, or anything else, which is refused.
        kind: the struct, whose annotations say what its fields hold.
        where: what messages call the value.
        error: what is raised where it has another form.
    """
    _lay_out(kind)
    try:
        return msgspec.convert(value, kind, dec_hook=_whole)
    except UnicodeError as problem:
        raise error(f"{where}: expected texts without lone surrogates") from problem
    except (msgspec.ValidationError, ValueError, OverflowError) as problem:
        text, _, place = str(problem).partition(" - at `")
        if place.startswith("key`"):
            text = "Expected `object` whose keys are texts"
        place = place.rstrip("`").rpartition("`")[2]
        raise error(_explained(text, place, value, kind, where)) from problem


def refuse(place: str, expected: str, value: object) -> NoReturn:
    """Raises that a place, such as `joint.axis`, should hold what is expected."""
    raise MisfitError(f".{place}: expected {expected}, found {shown(value)}")


def shown(value: object) -> str:
    """A value as messages quote it."""
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else text[: _LONGEST_QUOTE - 3] + "..."


def _lay_out(kind: object) -> None:
    with _FIRST:
        if kind not in _laid_out:
            msgspec.json.Decoder(kind, dec_hook=_whole)
            _laid_out.add(kind)


def _whole(kind: type, value: object) -> object:
    if kind is not Whole:
        raise NotImplementedError(kind)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError("Expected `int`")
    if value < 0:
        raise ValueError("Expected `int` >= 0")
    return Whole(value)


def _explained(text: str, place: str, value: object, kind: type, where: str) -> str:
    """What msgspec complains about, with the place, the valid choices and what was found."""
    held, form = value, inspect.type_info(kind)
    for field, index in _STEP.findall(place):
        held, form = _inside(held, field or index), _form_inside(form, field, index)
    where += place.removeprefix("$")
    if text.startswith("."):
        return where + text
    name = text.split("`")[1] if "`" in text else ""
    if text.startswith("Object contains unknown field"):
        return f"{where}: there is no field {name!r}; the fields are {', '.join(_choices(form))}"
    if text.startswith("Object missing required field"):
        return f"{where}: {name} is missing"
    if text.startswith("Invalid"):
        expected = f"one of {', '.join(_choices(form))}"
    elif "out of range" in text or "+308" in text:
        expected = "a finite number"
    else:
        expected = text.removeprefix("Expected ").partition(", got")[0]
        expected = re.sub(r"`(.*?)`", lambda kinds: _named(kinds[1]), expected)
        for bound, words in _BOUNDS.items():
            expected = re.sub(bound, words, expected)
    return f"{where}: expected {expected}, found {shown(held)}"


def _named(kinds: str) -> str:
    return " or ".join(_KINDS.get(kind, kind) for kind in kinds.split(" | "))


def _inside(value: object, step: str) -> object:
    if isinstance(value, dict):
        return value.get(step, value)
    return value[int(step)] if isinstance(value, list | tuple) else value


def _form_inside(form: inspect.Type, field: str, index: str) -> inspect.Type:
    """The type of a struct's field or of a list's entry."""
    for kind in form.types if isinstance(form, inspect.UnionType) else (form,):
        if isinstance(kind, inspect.StructType):
            forms = {known.encode_name: known.type for known in kind.fields}
            # A tag is no field: its choices are those of the union.
            return forms.get(field, form)
        if isinstance(kind, inspect.TupleType):
            return kind.item_types[int(index)]
        if isinstance(kind, inspect.VarTupleType | inspect.ListType):
            return kind.item_type
    return form


def _choices(form: inspect.Type) -> list[str]:
    """What may be written at a place: literals, tags, or the fields of an object."""
    if isinstance(form, inspect.UnionType):
        tags = [str(kind.tag) for kind in form.types if isinstance(kind, inspect.StructType)]
        return tags if len(tags) > 1 else [text for kind in form.types for text in _choices(kind)]
    if isinstance(form, inspect.StructType):
        tag = [form.tag_field] if form.tag_field else []
        return [*tag, *(field.encode_name for field in form.fields)]
    if isinstance(form, inspect.EnumType):
        return [str(choice.value) for choice in form.cls]
    return list(map(str, form.values)) if isinstance(form, inspect.LiteralType) else []
