"""YAML texts of users, read with bounds; every mistake is reported with its line.

Nothing in a text can make reading it costly: its size and depth are bounded, and anchors, aliases
and merge keys, with which a few lines can expand to gigabytes, are refused.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from buildarena_benchmark.errors import SourceError, ValidationIssue

MAX_BYTES: Final = 64 * 1024
"""Largest text: the longest built-in task has 3 KiB, a sweep of 10,000 named seeds 60."""

MAX_LEVELS: Final = 16
"""Deepest nesting; a task has five levels."""

Path = Sequence[int | str]
"""Place in a document: keys and indices from the top."""

_Schema = Mapping[str, Any]
_Model = TypeVar("_Model", bound=BaseModel)
_STEPS = re.compile(r"([^.\[\]]+)|\[(\d+)\]")
_MAPPING_WANTED = frozenset({"model_type", "model_attributes_type", "dict_type"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A YAML text that was read.

    Attributes:
        origin: Name of the text in messages, such as a file's name.
        root: Its nodes, with their lines; None when the text is empty.
    """

    origin: str
    content: Any
    root: yaml.Node | None

    def line_of(self, path: Path) -> int | None:
        """Return the line of a field, or of the nearest thing around it; from 1."""
        return self._locate(path)[1]

    def issues(self, error: ValidationError, model: type[BaseModel]) -> tuple[ValidationIssue, ...]:
        """Return the schema's objections to the content, in words, with lines and valid choices."""
        schema = model.model_json_schema()
        issues = [self._issue(item, schema) for item in error.errors(include_url=False)]
        return tuple(dict.fromkeys(issues))

    def _issue(self, item: ErrorDetails, schema: _Schema) -> ValidationIssue:
        field, line = self._locate(item["loc"])
        choices: Sequence[str] = item.get("ctx", {}).get("choices", ())
        message = item["msg"].removeprefix("Value error, ")
        if item["type"] == "extra_forbidden":
            message, choices = "unknown field", _fields_beside(item["loc"], schema)
        elif item["type"] in _MAPPING_WANTED:
            message = "must be a mapping of fields"
        return ValidationIssue(path=field, line=line, message=message, choices=tuple(choices))

    def _locate(self, path: Path) -> tuple[str, int | None]:
        node, field = self.root, ""
        line = node.start_mark.line + 1 if node else None
        for step in path:
            below = _child(node, step)
            if below is not None:
                node, line = below
            elif not isinstance(node, yaml.MappingNode) or (field and step != path[-1]):
                # Unions add the chosen member's name to a path; the text has no such field.
                continue
            field += f"[{step}]" if isinstance(step, int) else f".{step}" if field else step
        return field, line


def parse_source(text: str, *, origin: str, max_bytes: int = MAX_BYTES) -> Source:
    """Read a YAML text.

    Args:
        max_bytes: Largest size, as UTF-8.

    Raises:
        SourceError: It is too large, not valid YAML, or uses a refused feature.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > max_bytes:
        message = f"{size:,} bytes; at most {max_bytes:,} are read"
        raise SourceError([ValidationIssue(message=message)], origin=origin)
    try:
        loader = _CarefulLoader(text)
        try:
            root = loader.get_single_node()
            content = None if root is None else loader.construct_document(root)
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = None if mark is None else mark.line + 1
        message = str(error.problem or error.context)
        if not isinstance(error, _Refused):
            message = f"not valid YAML: {message}"
        raise SourceError([ValidationIssue(message=message, line=line)], origin=origin) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        message = f"not valid YAML: {error.reason}"
        raise SourceError([ValidationIssue(message=message, line=line)], origin=origin) from error
    if issues := list(_key_issues(root, "")):
        raise SourceError(issues, origin=origin)
    return Source(origin=origin, content=content, root=root)


def parse_model(text: str, model: type[_Model], *, origin: str) -> _Model:
    """Return the content of a YAML text, as a model.

    Raises:
        SourceError: It cannot be read, or does not fit the model.
    """
    source = parse_source(text, origin=origin)
    try:
        return model.model_validate(source.content)
    except ValidationError as error:
        raise SourceError(source.issues(error, model), origin=origin) from error


def path_of(field: str) -> Path:
    """Return the path that a field's spelling means: ``models[1]`` is ("models", 1)."""
    return [int(index) if index else name for name, index in _STEPS.findall(field)]


class _Refused(yaml.MarkedYAMLError):
    """Valid YAML that is not accepted here."""


class _CarefulLoader(yaml.SafeLoader):
    """Loader of plain values, from texts without anchors, aliases and great depth."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._level = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]  # its stub lacks it
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            message = "anchors and aliases are not allowed: write the value out"
            raise _Refused(problem=message, problem_mark=event.start_mark)
        if self._level >= MAX_LEVELS:
            message = f"nested more than {MAX_LEVELS} levels deep"
            raise _Refused(problem=message, problem_mark=event.start_mark)
        self._level += 1
        node = super().compose_node(parent, index)
        self._level -= 1
        return node

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        for key, _ in node.value:
            if key.tag == "tag:yaml.org,2002:merge":
                message = "merge keys are not allowed: write the fields out"
                raise _Refused(problem=message, problem_mark=key.start_mark)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, OverflowError) as error:
            # A number of ten thousand digits, a thirteenth month.
            message = f"the value cannot be read: {error}"
            raise _Refused(problem=message, problem_mark=node.start_mark) from error


def _key_issues(node: yaml.Node | None, around: str) -> Iterator[ValidationIssue]:
    """Return the keys that are not text, or that appear twice in one mapping."""
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield from _key_issues(item, f"{around}[{index}]")
    if not isinstance(node, yaml.MappingNode):
        return
    lines: dict[str, int] = {}
    for key, value in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
            shown = key.value if isinstance(key, yaml.ScalarNode) else "a collection"
            yield ValidationIssue(path=around, line=line, message=f"the key {shown} is not text")
            continue
        field = f"{around}.{key.value}" if around else key.value
        if key.value in lines:
            message = f"appears twice, first in line {lines[key.value]}"
            yield ValidationIssue(path=field, line=line, message=message)
        lines.setdefault(key.value, line)
        yield from _key_issues(value, field)


def _child(node: yaml.Node | None, step: int | str) -> tuple[yaml.Node, int] | None:
    """Return what lies below a node, and the line of its key or of itself."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == step:
                return value, key.start_mark.line + 1
    if isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
        item = node.value[step]
        return item, item.start_mark.line + 1
    return None


def _fields_beside(path: Path, schema: _Schema) -> tuple[str, ...]:
    """Return the names of the fields that are valid where an unknown one was found."""
    node: _Schema = schema
    for step in path[:-1]:
        node = _resolve(node, schema)
        options = [_resolve(o, schema) for o in node.get("oneOf") or node.get("anyOf") or ()]
        if options:
            fitting = (o for o in options if step in (_tag(o), *o.get("properties", {})))
            node = next(fitting, {})
            if _tag(node) == step:
                continue
        node = node.get("properties", {}).get(step) or node.get("items") or {}
    node = _resolve(node, schema)
    if "anyOf" in node:  # a field that may be null
        node = next(
            (o for o in (_resolve(o, schema) for o in node["anyOf"]) if o.get("properties")), {}
        )
    return tuple(node.get("properties", {}))


def _resolve(part: _Schema, schema: _Schema) -> _Schema:
    reference = part.get("$ref")
    if reference is None:
        return part
    resolved: _Schema = schema["$defs"][reference.rsplit("/", 1)[1]]
    return resolved


def _tag(option: _Schema) -> str | None:
    for name in ("name", "kind"):
        tag = option.get("properties", {}).get(name, {}).get("const")
        if tag:
            return str(tag)
    return None
