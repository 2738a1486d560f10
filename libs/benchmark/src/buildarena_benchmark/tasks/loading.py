"""Reads task files: the built-in ones and a user's own."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from buildarena_benchmark.errors import TaskError
from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.task import Task, task_of

_Schema = dict[str, Any]
"""A JSON schema, as pydantic writes it."""

_ORDER: Final = tuple(
    f"{category}-{level}" for category in ("transport", "support", "lift") for level in (1, 2, 3)
)


@cache
def builtin_tasks() -> Mapping[str, Task]:
    """The nine built-in tasks by name, in the paper's order."""
    folder = resources.files("buildarena_benchmark.tasks") / "catalogue"
    tasks = {}
    for name in _ORDER:
        text = (folder / f"{name}.yaml").read_text(encoding="utf-8")
        tasks[name] = _parse(text, origin=f"{name}.yaml")
    return MappingProxyType(tasks)


def load_task(source: str | Path) -> Task:
    """A task from a YAML text or file.

    Args:
        source: A `Path`, a one-line string naming a file, or the YAML text itself.

    Raises:
        TaskError: The file cannot be read or is no valid task; names line, field and choices.
    """
    if isinstance(source, Path) or "\n" not in source:
        path = Path(source)
        try:
            return _parse(path.read_text(encoding="utf-8"), origin=path.name)
        except (OSError, UnicodeDecodeError) as error:
            raise TaskError(f"{path}: cannot be read: {error}") from error
    return _parse(source, origin="task")


def _parse(text: str, *, origin: str) -> Task:
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:
        raise TaskError(f"{origin}: no valid YAML: {error}") from error
    try:
        return task_of(TaskDocument.model_validate(content))
    except ValidationError as error:
        lines = [_described(item, node) for item in error.errors(include_url=False)]
        raise TaskError(f"{origin}: " + "; ".join(lines)) from error


def _described(item: ErrorDetails, root: yaml.Node | None) -> str:
    """One error in words: line, field, what is wrong, valid choices."""
    # A union adds the chosen member's tag to the path; the file has no such field.
    field, line = _locate(item["loc"], root)
    choices = ""
    if item["type"] == "extra_forbidden":
        known = _fields_beside(item["loc"])
        if known:
            choices = f" (fields: {', '.join(known)})"
    where = f"line {line}, " if line else ""
    return f"{where}field {field or '(top)'}: {item['msg']}{choices}"


def _locate(path: Sequence[int | str], root: yaml.Node | None) -> tuple[str, int | None]:
    names: list[str] = []
    node = root
    line = root.start_mark.line + 1 if root else None
    for step in path:
        below = _child(node, step)
        if below is None and names and step != path[-1]:
            continue
        names.append(str(step))
        if below is not None:
            node, line = below, below.start_mark.line + 1
    return ".".join(names), line


def _child(node: yaml.Node | None, step: int | str) -> yaml.Node | None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == step:
                return value if isinstance(value, yaml.Node) else None
    if isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
        item = node.value[step]
        return item if isinstance(item, yaml.Node) else None
    return None


def _fields_beside(path: Sequence[int | str]) -> tuple[str, ...]:
    """Names of the fields that are valid where an unknown one was found."""
    schema = TaskDocument.model_json_schema()
    here: _Schema = schema
    for step in path[:-1]:
        here = _resolved(here, schema)
        options = here.get("oneOf") or here.get("anyOf")
        if options:
            tagged = [
                option
                for option in (_resolved(option, schema) for option in options)
                if step in (_tag(option), *option.get("properties", {}))
            ]
            here = tagged[0] if tagged else {}
            if _tag(here) == step:
                continue
        here = here.get("properties", {}).get(step) or here.get("items") or {}
    return tuple(_resolved(here, schema).get("properties", {}))


def _resolved(part: _Schema, schema: _Schema) -> _Schema:
    reference = part.get("$ref")
    if reference is None:
        return part
    found: _Schema = schema["$defs"][reference.rsplit("/", 1)[1]]
    return found


def _tag(option: _Schema) -> str | None:
    for name in ("name", "kind"):
        tag = option.get("properties", {}).get(name, {}).get("const")
        if tag:
            return str(tag)
    return None
