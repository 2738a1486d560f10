"""The action space: each action as a tool for models, and how its arguments are read.

Names, descriptions and schemas come from the actions' signatures and docstrings, so they always
agree with what the actions do.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, get_args, get_type_hints

from buildarena_geometry.actions import (
    assemble,
    build,
    catalogue,
    control,
    mirror,
    program,
    query,
    refine,
    remove,
)
from buildarena_geometry.changes import Change
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.modules.parameters import (
    JsonSchema,
    Parameter,
    malformed,
    object_schema,
    shown,
)

GROUPS = ("build", "refine", "assemble", "control", "query")
"""What every builder has."""
LOOKUP = "lookup"
"""What builders also have where they look modules up on demand."""
PROGRAM = "program"
"""What builders also have where a program may act."""
ALL_GROUPS = (*GROUPS, LOOKUP, PROGRAM)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolDefinition:
    """One action as a model's API takes it.

    Attributes:
        name: the action's name.
        description: what it does.
        parameters: JSON schema of its arguments, an object.
        group: one of `ALL_GROUPS`; empty for a tool that is not a machine's action.
    """

    name: str
    description: str
    parameters: JsonSchema
    group: str = ""

    def as_document(self) -> dict[str, Any]:
        """What a model is given, as JSON values."""
        return {
            "name": self.name,
            "description": self.description,
            "parameters": dict(self.parameters),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """An action the dispatcher can carry out.

    Attributes:
        definition: what models are given.
        propose: makes the change from a state and the arguments, or raises RefusalError.
        readers: how each argument is read.
        required: the arguments without a default.
    """

    definition: ToolDefinition
    propose: Callable[..., Change]
    readers: Mapping[str, Parameter] = field(repr=False)
    required: tuple[str, ...]

    def read(self, arguments: object) -> dict[str, Any]:
        """The arguments as the action takes them.

        Raises:
            RefusalError: they are not an object, one is missing or unknown, or one has a bad value.
        """
        name, given = self.definition.name, {} if arguments is None else arguments
        if not isinstance(given, Mapping):
            raise malformed(f"{name} takes an object of arguments, not {shown(given)}.")
        takes = f"{name} takes: {listing(self.readers)}."
        for argument in given:
            if not isinstance(argument, str) or argument not in self.readers:
                raise malformed(f"There is no argument {shown(argument)}. {takes}")
        missing = [argument for argument in self.required if argument not in given]
        if missing:
            raise malformed(f"Missing: {listing(missing)}. {takes}")
        return {
            argument: self.readers[argument].read(argument, value)
            for argument, value in given.items()
            if value is not None or argument in self.required
        }


MAX_BATCH = 50
"""Actions that one `build` carries out at most."""
BATCH = ToolDefinition(
    name="build",
    description=f"Carry out up to {MAX_BATCH} actions in order. Stops at the first refused one; "
    "the actions before it are kept.",
    parameters=object_schema(
        {
            "actions": {
                "type": "array",
                "items": {
                    "type": "object",
                    "properties": {"tool": {"type": "string"}, "arguments": {"type": "object"}},
                    "required": ["tool"],
                },
            }
        },
        ["actions"],
    ),
    group="build",
)


def read_batch(arguments: Any) -> list[tuple[str, object]]:
    """Return the actions of a `build`, each with its arguments.

    Raises:
        RefusalError: they are not a list of such actions, or too many.
    """
    actions: Any = arguments.get("actions") if isinstance(arguments, Mapping) else ()
    listed = isinstance(actions, list | tuple) and 0 < len(actions) <= MAX_BATCH
    if not listed or len(arguments) > 1 or not all(map(_is_call, actions)):
        form = f'"actions", a list of 1 to {MAX_BATCH} objects of "tool" and "arguments"'
        raise malformed(f"build takes {form}, and nothing else.")
    return [(action["tool"], action.get("arguments")) for action in actions]


def _is_call(value: Any) -> bool:
    is_object = isinstance(value, Mapping) and value.keys() <= {"tool", "arguments"}
    return is_object and isinstance(value.get("tool"), str)


def tool_definitions(groups: Iterable[str] = GROUPS) -> tuple[ToolDefinition, ...]:
    """The actions of some groups as tools for models.

    Args:
        groups: names from `ALL_GROUPS`.

    Returns:
        The definitions, group by group in the order asked for.

    Raises:
        ValueError: a group that does not exist.
    """
    wanted = tuple(groups)
    for group in wanted:
        if group not in ALL_GROUPS:
            known = ", ".join(ALL_GROUPS)
            raise ValueError(f"there is no group {group!r}; the groups are {known}")
    definitions = [*(action.definition for action in ACTIONS.values()), BATCH]
    return tuple(tool for group in wanted for tool in definitions if tool.group == group)


_EXPLAINED = frozenset(
    {"init_rotation", "rotation", "machine_id", "more", "index", "plane", "block_ids", "program"}
)
"""Arguments whose descriptions say more than their names and the tools' own descriptions."""


def _action(propose: Callable[..., Change], group: str) -> Action:
    signature = inspect.signature(propose)
    hints = get_type_hints(propose, include_extras=True)
    description, about = _parse_docstring(inspect.getdoc(propose) or "")
    arguments = [name for name in signature.parameters if name != "state"]
    readers = {name: _parameter(hints[name]) for name in arguments}
    required = tuple(
        name for name in arguments if signature.parameters[name].default is inspect.Parameter.empty
    )
    told = {name: {"description": about[name]} if name in _EXPLAINED else {} for name in arguments}
    schema = object_schema(
        {name: readers[name].schema | told[name] for name in arguments}, required
    )
    definition = ToolDefinition(
        name=propose.__name__, description=description, parameters=schema, group=group
    )
    return Action(definition=definition, propose=propose, readers=readers, required=required)


def _parameter(hint: object) -> Parameter:
    """What an argument is annotated with; see `buildarena_geometry.modules.parameters`."""
    (parameter,) = (note for note in get_args(hint) if isinstance(note, Parameter))
    return parameter


def _parse_docstring(text: str) -> tuple[str, dict[str, str]]:
    """The description and the arguments' texts of a Google style docstring, each on one line."""
    head, _, rest = text.partition("Args:\n")
    about: dict[str, str] = {}
    for line in inspect.cleandoc(rest).splitlines():
        if line.startswith(" "):
            about[list(about)[-1]] += " " + line.strip()
        else:
            name, _, words = line.partition(": ")
            about[name] = words
    return " ".join(head.split()), about


def _proposers(module: ModuleType) -> Iterator[Callable[..., Change]]:
    """The actions of a module: what is public there and proposes a change."""
    for function in filter(inspect.isfunction, vars(module).values()):
        if function.__annotations__.get("return") is Change and not function.__name__.startswith(
            "_"
        ):
            yield function


_MODULES: Mapping[str, tuple[ModuleType, ...]] = {
    "build": (build, mirror, remove),
    "refine": (refine,),
    "assemble": (assemble,),
    "control": (control,),
    "query": (query,),
    LOOKUP: (catalogue,),
    PROGRAM: (program,),
}
ACTIONS: Mapping[str, Action] = {
    propose.__name__: _action(propose, group)
    for group, modules in _MODULES.items()
    for module in modules
    for propose in _proposers(module)
}
_NAMES = CaselessNames(ACTIONS)


def is_batch(written: object) -> bool:
    """Return whether a name means `build`, in any case."""
    return isinstance(written, str) and written.strip().casefold() == BATCH.name


def action_named(written: str) -> Action | None:
    """The action a name means, whatever its case; None if there is none."""
    name = _NAMES.find(written)
    return None if name is None else ACTIONS[name]
