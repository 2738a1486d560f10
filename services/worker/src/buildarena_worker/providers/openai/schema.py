"""Tools as OpenAI's chat completions describe them.

A tool whose schema fits OpenAI's strict mode is sent in it: the model then can't give arguments
of another form. Source: OpenAI's guides to structured outputs and function calling.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from buildarena_geometry import ToolDefinition

DROPPED = ("title", "$schema", "discriminator")
"""Keywords that say nothing about the arguments."""
NOT_STRICT = frozenset(
    {
        "default",
        "oneOf",
        "patternProperties",
        "unevaluatedProperties",
        "propertyNames",
        "minProperties",
        "maxProperties",
        "unevaluatedItems",
        "contains",
        "minContains",
        "maxContains",
        "uniqueItems",
        "prefixItems",
    }
)
"""Keywords that strict mode does not know."""
STRICT_FORMATS = frozenset(
    {"date-time", "time", "date", "duration", "email", "hostname", "ipv4", "ipv6", "uuid"}
)
TYPED = frozenset({"type", "$ref", "anyOf", "oneOf", "allOf", "enum", "const"})
"""Keywords of which one must describe the items of an array in strict mode."""
DEFINITION = re.compile(r"#(/(\$defs|definitions)/[^/]+)?")
"""References that strict mode can follow."""
LOOKAROUND = re.compile(r"(?:^|[^\\])(?:\\\\)*\(\?<?[=!]")
UNIONS = ("allOf", "anyOf", "oneOf")


def function_tool(tool: ToolDefinition) -> dict[str, Any]:
    """The tool as a function of the wire's ``tools``."""
    parameters = _written(tool.parameters)
    definitions = tool.parameters.get("$defs")
    if definitions:
        parameters.pop("$defs")
        parameters["$defs"] = {name: _written(one) for name, one in definitions.items()}
    function: dict[str, Any] = {
        "name": tool.name,
        "description": tool.description,
        "parameters": parameters,
    }
    if _strict(parameters):
        function["strict"] = True
    return {"type": "function", "function": function}


def _written(schema: Any) -> Any:
    """The schema without idle keywords, with objects closed unless they say that they are open."""
    if not isinstance(schema, Mapping):
        return schema
    written = {name: value for name, value in schema.items() if name not in DROPPED}
    typed = "type" in written
    for union in UNIONS:
        if union in written:
            members = [_written(member) for member in written[union]]
            if len(members) == 1 and not typed and isinstance(members[0], dict):
                del written[union]
                written = members[0] | written
            else:
                written[union] = members
    if "$ref" in written and len(written) > 1:
        # Strict mode allows nothing beside a reference, but everything beside a union of one.
        written["anyOf"] = [{"$ref": written.pop("$ref")}]
    if written.get("type") == "object":
        properties = written.get("properties", {})
        written["properties"] = {name: _written(one) for name, one in properties.items()}
        if written.get("additionalProperties") is None:
            written["additionalProperties"] = False
        written["additionalProperties"] = _written(written["additionalProperties"])
    if written.get("type") == "array" and isinstance(written.get("items"), Mapping):
        written["items"] = _written(written["items"])
    return written


def _strict(schema: Any) -> bool:
    """Whether strict mode takes a written schema."""
    if not isinstance(schema, Mapping):
        return True
    fits = (
        NOT_STRICT.isdisjoint(schema)
        and schema.get("format", "uuid") in STRICT_FORMATS
        and not LOOKAROUND.search(str(schema.get("pattern", "")))
        and DEFINITION.fullmatch(schema.get("$ref", "#"))
        and (schema.get("type") != "object" or _closed(schema))
        and (schema.get("type") != "array" or _typed(schema.get("items")))
    )
    parts = [*schema.get("properties", {}).values(), *schema.get("$defs", {}).values()]
    parts += [member for union in UNIONS for member in schema.get(union, ())]
    return bool(fits) and all(_strict(part) for part in [*parts, schema.get("items")])


def _closed(schema: Mapping[str, Any]) -> bool:
    """Whether an object says that it has all of its properties and no others."""
    required = schema.get("required")
    return (
        schema["additionalProperties"] is False
        and required is not None
        and all(name in required for name in schema["properties"])
    )


def _typed(items: Any) -> bool:
    return isinstance(items, Mapping) and not TYPED.isdisjoint(items)
