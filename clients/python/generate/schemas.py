"""Writes the API's documents as TypedDicts: ``schemas.py CONTRACT`` prints the module."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

HEAD: Final = '''\
"""The API's documents, as its contract describes them. Generated: `make openapi` writes this file.

A key that may be missing is NotRequired. Nothing checks a document against its type: a newer
service may have added keys.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired, TypedDict

Timestamp = Annotated[str, "date-time"]
"""A moment, as ISO 8601 with its zone."""
'''
FILTERS: Final = {
    "BoardFilters": ("/v1/leaderboard", "Which jobs a leaderboard is made of."),
    "JobFilters": ("/v1/jobs", "Which jobs are listed, and in which order."),
}
"""Parameters that methods pass on, by the route whose they are."""
PAGING: Final = {"cursor", "limit"}
RUNNERS: Final = "/v1/runner"
PLAIN: Final = {
    "string": "str",
    "integer": "int",
    "number": "float",
    "boolean": "bool",
    "null": "None",
    "date-time": "Timestamp",
}
"""Python's types by the contract's formats and types."""
WIDTH: Final = 96


def written(contract: Mapping[str, Any]) -> str:
    """The module.

    Args:
        contract: The OpenAPI document.
    """
    schemas = contract["components"]["schemas"]
    parts = [HEAD]
    names = sorted(_used(contract))
    parts += [_alias(name, schemas[name]) for name in names if "properties" not in schemas[name]]
    parts += [_class(name, schemas[name]) for name in names if "properties" in schemas[name]]
    parts += [_filters(name, contract) for name in FILTERS]
    return _formatted("\n\n".join(parts) + "\n")


def _used(contract: Mapping[str, Any]) -> set[str]:
    """Schemas of all routes but those of runners, which have a client of their own."""
    found: set[str] = set()
    waiting = [
        name
        for path, operations in contract["paths"].items()
        if not path.startswith(RUNNERS)
        for name in _referred(operations)
    ]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _referred(contract["components"]["schemas"][name])
    return found


def _referred(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        if isinstance(node.get("$ref"), str):
            yield node["$ref"].rpartition("/")[2]
        for value in node.values():
            yield from _referred(value)
    elif isinstance(node, list):
        for value in node:
            yield from _referred(value)


def _class(name: str, schema: Mapping[str, Any]) -> str:
    required = set(schema.get("required", ()))
    fields = schema["properties"]
    body = [
        f"    {key}: {_type(of) if key in required else f'NotRequired[{_type(of)}]'}"
        for key, of in fields.items()
    ]
    text = _docstring(schema.get("description", ""), name, fields)
    return "\n".join([f"class {name}(TypedDict):", text, "", *body])


def _filters(name: str, contract: Mapping[str, Any]) -> str:
    path, text = FILTERS[name]
    fields = {
        found["name"]: {**found["schema"], "description": found.get("description", "")}
        for found in contract["paths"][path]["get"]["parameters"]
        if found["in"] == "query" and found["name"] not in PAGING
    }
    body = [f"    {key}: {_type(of)}" for key, of in fields.items()]
    head = f"class {name}(TypedDict, total=False):"
    return "\n".join([head, _docstring(text, name, fields), "", *body])


def _alias(name: str, schema: Mapping[str, Any]) -> str:
    text = " ".join(schema.get("description", name).partition("\n\n")[0].split())
    return f'{name} = {_type(schema)}\n"""{_sentence(text)}"""'


def _type(schema: Mapping[str, Any]) -> str:
    """The Python type of a schema."""
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if "anyOf" in schema:
        return " | ".join(dict.fromkeys(_type(one) for one in schema["anyOf"]))
    if "const" in schema or "enum" in schema:
        values = schema.get("enum", [schema.get("const")])
        return f"Literal[{', '.join(map(repr, values))}]"
    kind = schema.get("type")
    if kind == "array":
        return _array(schema)
    if kind == "object":
        values = schema.get("additionalProperties", True)
        return f"dict[str, {_type(values) if isinstance(values, dict) else 'Any'}]"
    return PLAIN.get(schema.get("format", kind), PLAIN.get(str(kind), "Any"))


def _array(schema: Mapping[str, Any]) -> str:
    # JSON has no tuples: what is read is a list, whatever its length.
    kinds = [_type(one) for one in schema.get("prefixItems", ())] or [_type(schema["items"])]
    return f"list[{' | '.join(dict.fromkeys(kinds))}]"


def _docstring(text: str, name: str, fields: Mapping[str, Any]) -> str:
    first, *rest = text.strip().partition("\n\n")[::2]
    lines = [_sentence(" ".join(first.split()) or f"{name}.")]
    told = {key: " ".join(of.get("description", "").split()) for key, of in fields.items()}
    told = {key: said for key, said in told.items() if said}
    paragraphs = [" ".join(part.split()) for part in "".join(rest).split("\n\n") if part.strip()]
    for paragraph in paragraphs:
        if not paragraph.startswith("Attributes:"):
            lines += ["", *textwrap.wrap(_sentence(paragraph), WIDTH)]
    if told:
        lines += ["", "Attributes:"]
        for key, said in told.items():
            lines += textwrap.wrap(
                f"{key}: {_sentence(said)}",
                WIDTH,
                initial_indent="    ",
                subsequent_indent="        ",
            )
    if len(lines) == 1:
        return f'    """{lines[0]}"""'
    shown = textwrap.indent("\n".join(lines), "    ").removeprefix("    ")
    return f'    """{shown}\n    """'


def _sentence(text: str) -> str:
    text = text.replace("\\", "\\\\").replace('"""', "'''")
    return text if text.endswith((".", "?", "!")) else f"{text}."


def _formatted(text: str) -> str:
    ruff = Path(sys.executable).with_name("ruff")
    words = [str(ruff), "format", "--quiet", "--stdin-filename", "schemas.py", "-"]
    return subprocess.run(words, input=text, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    sys.stdout.write(written(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))
