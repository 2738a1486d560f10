"""Conversion of JSON values that people wrote into typed structs; errors name the field.

msgspec converts. If it refuses, value and form are compared up to the first place
where they differ, and the error shows the expected and the actual value.
"""

import sys
import threading
from collections.abc import Iterable, Mapping
from types import NoneType
from typing import Annotated, Any, NoReturn, TypeVar

import msgspec
from msgspec import Meta, inspect

from buildarena_geometry.errors import GeometryError

_LARGEST = sys.float_info.max
_LONGEST_QUOTE = 60  # characters; one line of a terminal
Finite = Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)]
Amount = Annotated[float, Meta(ge=0.0, le=_LARGEST)]
Positive = Annotated[float, Meta(gt=0.0, le=_LARGEST)]
Point = tuple[Finite, Finite, Finite]
Name = Annotated[str, Meta(max_length=60)]

_KINDS: Mapping[type[inspect.Type], tuple[str, tuple[type, ...]]] = {
    inspect.BoolType: ("true or false", (bool,)),
    inspect.IntType: ("a whole number", (int,)),
    inspect.CustomType: ("a whole number", (int, float)),
    inspect.FloatType: ("a number", (int, float)),
    inspect.StrType: ("a text", (str,)),
    inspect.EnumType: ("a text", (str,)),
    inspect.TupleType: ("a list", (list, tuple)),
    inspect.VarTupleType: ("a list", (list, tuple)),
    inspect.ListType: ("a list", (list, tuple)),
    inspect.DictType: ("an object", (Mapping,)),
    inspect.StructType: ("an object", (Mapping,)),
    inspect.NoneType: ("null", (NoneType,)),
    inspect.AnyType: ("anything", (object,)),
}
"""What messages call the values of a form, and how Python has them."""
_Read = TypeVar("_Read")
_FIRST = threading.Lock()
"""msgspec lays a struct's form out when it is first read; two threads at once crash there."""
_laid_out: set[object] = set()


class Whole(int):
    """A whole number that is not negative, as JSON spells it: 2.0 is as whole as 2."""


class Form(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of a file: its fields are exactly those of the struct."""


class Sourced(Form, frozen=True, kw_only=True):
    """A form that says where its figures come from."""

    origin: str = ""


class FieldError(ValueError):
    """A field that is good by itself does not fit the others; the text begins with its place."""


def read(value: object, kind: type[_Read], *, where: str, error: type[GeometryError]) -> _Read:
    """Convert a JSON value to a struct.

    Args:
        value: any object; only JSON values in Python's types are accepted.
        kind: struct whose annotations define the fields.
        where: name of the value in messages.
        error: type of the exception for a value of another form.
    """
    with _FIRST:
        if kind not in _laid_out:
            msgspec.json.Decoder(kind, dec_hook=_whole)
            _laid_out.add(kind)
    try:
        return msgspec.convert(value, kind, dec_hook=_whole)
    except UnicodeError as problem:
        raise error(f"{where}: expected texts without lone surrogates") from problem
    except (msgspec.ValidationError, ValueError) as problem:
        fault = _fault(value, inspect.type_info(kind)) or f": {problem}"
        raise error(where + fault) from problem


def refuse(place: str, expected: str, value: object) -> NoReturn:
    """Raise that a field, such as `joint.axis`, should have the expected value."""
    raise FieldError(f".{place}{_unlike(expected, value)}")


def quote(value: object) -> str:
    """Format a value for messages."""
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else text[: _LONGEST_QUOTE - 3] + "..."


def _whole(kind: type, value: Any) -> object:
    if kind is not Whole:
        raise NotImplementedError(kind)
    if not isinstance(value, int | float) or isinstance(value, bool) or value % 1 or value < 0:
        raise ValueError(value)
    return Whole(value)


def _unlike(expected: str, value: object) -> str:
    return f": expected {expected}, found {quote(value)}"


def _fault(value: Any, form: Any) -> str:
    """Return the first mismatch of a value and a form, after its path; "" if they match."""
    forms: tuple[Any, ...] = form.types if isinstance(form, inspect.UnionType) else (form,)
    suiting = [option for option in forms if _is_of(value, _kind(option))]
    if not suiting:
        kinds = {_kind(option) for option in forms}
        named = dict.fromkeys(title for kind, (title, _) in _KINDS.items() if kind in kinds)
        return _unlike(" or ".join(named), value)
    if tag := getattr(suiting[0], "tag_field", None):
        if tag not in value:
            return f": {tag} is missing"
        tagged = [option for option in suiting if option.tag == value[tag]]
        if not tagged:
            return f".{tag}{_unlike(_one_of(option.tag for option in suiting), value[tag])}"
        suiting = tagged
    return _fault_within(value, suiting[0])


def _kind(form: inspect.Type) -> type[inspect.Type]:
    if isinstance(form, inspect.LiteralType):
        return inspect.StrType if isinstance(form.values[0], str) else inspect.IntType
    return type(form)


def _is_of(value: object, kind: type[inspect.Type]) -> bool:
    types = _KINDS[kind][1]
    # To Python true is a number.
    return isinstance(value, types) and (not isinstance(value, bool) or int not in types)


def _one_of(choices: Iterable[object]) -> str:
    return f"one of {', '.join(map(str, choices))}"


def _fault_within(value: Any, form: Any) -> str:
    """Return the first mismatch of a value that has the form's kind."""
    match form:
        case inspect.StructType():
            return _fault_of_object(value, form)
        case inspect.DictType():
            if not all(isinstance(key, str) for key in value):
                return _unlike("an object whose keys are texts", value)
            steps = [(f".{key}", entry, form.value_type) for key, entry in value.items()]
        case inspect.TupleType():
            if len(value) != len(form.item_types):
                return _unlike(f"a list of length {len(form.item_types)}", value)
            pairs = zip(value, form.item_types, strict=True)
            steps = [(f"[{index}]", entry, item) for index, (entry, item) in enumerate(pairs)]
        case inspect.VarTupleType() | inspect.ListType():
            steps = [(f"[{index}]", entry, form.item_type) for index, entry in enumerate(value)]
        case _:
            expected = _expected(value, form)
            return _unlike(expected, value) if expected else ""
    faults = ((place, _fault(entry, inner)) for place, entry, inner in steps)
    return next((place + fault for place, fault in faults if fault), "")


def _fault_of_object(value: Mapping[Any, object], form: inspect.StructType) -> str:
    fields = {field.encode_name: field for field in form.fields}
    for name, entry in value.items():
        if not isinstance(name, str):
            return _unlike("an object whose keys are texts", value)
        if name in fields:
            if fault := _fault(entry, fields[name].type):
                return f".{name}{fault}"
        elif form.forbid_unknown_fields and name != form.tag_field:
            choices = ", ".join([*([form.tag_field] if form.tag_field else []), *fields])
            return f": unknown field {name!r}; valid fields: {choices}"
    for name, field in fields.items():
        if field.required and name not in value:
            return f": {name} is missing"
    try:
        msgspec.convert(value, form.cls, dec_hook=_whole)
    except msgspec.ValidationError as problem:
        # The struct itself checks that its fields are consistent.
        return str(problem.__cause__) if isinstance(problem.__cause__, FieldError) else ""
    return ""


def _expected(value: Any, form: Any) -> str:  # noqa: PLR0911  each bound has its words
    """Return the bounds that a value of the form's kind breaks; "" if none."""
    match form:
        case inspect.LiteralType(values=choices) if value not in choices:
            return _one_of(choices)
        case inspect.EnumType(cls=choices) if value not in list(choices):
            return _one_of(choices)
        case inspect.StrType(max_length=int(most)) if len(value) > most:
            return f"a text of at most {most} characters"
        case inspect.CustomType() if value % 1 or value < 0:
            return "a whole number" + ("" if value % 1 else " of at least 0")
        case inspect.FloatType(gt=float(least)) if not value > least:
            return f"a number above {least:g}"
        case inspect.FloatType(ge=float(least)) if not value >= least:
            return "a finite number" if least == -_LARGEST else f"a number of at least {least:g}"
        case inspect.FloatType(le=float(most)) if not value <= most:
            return "a finite number" if most == _LARGEST else f"a number of at most {most:g}"
    return ""
