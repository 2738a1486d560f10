"""The action space: each action as a tool for models, and how its arguments are read.

Names, descriptions and schemas come from the actions' signatures and docstrings, so they always
agree with what the actions do.
"""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, get_args, get_type_hints

from buildarena_geometry.actions import assemble, build, catalogue, control, program, query, refine
from buildarena_geometry.actions.parameters import (
    JsonSchema,
    Parameter,
    malformed,
    object_schema,
    quote,
)
from buildarena_geometry.feedback.words import listing
from buildarena_geometry.modules.names import CaselessNames
from buildarena_geometry.state import Change

GROUPS = ("build", "refine", "assemble", "control", "query")
"""What every builder has."""
LOOKUP = "lookup"
"""What builders also have where they look modules up on demand."""
PROGRAM = "program"
"""What builders also have where a program may act."""
ALL_GROUPS = (*GROUPS, LOOKUP, PROGRAM)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolDefinition:
    """An action as a tool of a model's API.

    Attributes:
        parameters: JSON schema of its arguments, an object.
        group: one of `ALL_GROUPS`; empty for a tool that is not an action on a machine.
    """

    name: str
    description: str
    parameters: JsonSchema
    group: str = ""

    def as_document(self) -> dict[str, Any]:
        """Return the definition that a model receives, as JSON values."""
        return {
            "name": self.name,
            "description": self.description,
            "parameters": dict(self.parameters),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """An action that the dispatcher can execute.

    Attributes:
        definition: definition that models receive.
        propose: function that makes the change from a state and the arguments, or raises
            RefusalError.
        readers: reader of each argument.
        required: the arguments without a default.
    """

    definition: ToolDefinition
    propose: Callable[..., Change]
    readers: Mapping[str, Parameter] = field(repr=False)
    required: tuple[str, ...]

    def read(self, arguments: object) -> dict[str, Any]:
        """Parse the arguments for the action.

        Raises:
            RefusalError: they are not an object, one is missing or unknown, or one has a bad value.
        """
        name, received = self.definition.name, {} if arguments is None else arguments
        if not isinstance(received, Mapping):
            raise malformed(f"{name} takes an object of arguments, not {quote(received)}.")
        takes = f"{name} takes: {listing(self.readers)}."
        for argument in received:
            if not isinstance(argument, str) or argument not in self.readers:
                raise malformed(f"There is no argument {quote(argument)}. {takes}")
        missing = [argument for argument in self.required if argument not in received]
        if missing:
            raise malformed(f"Missing: {listing(missing)}. {takes}")
        return {
            argument: self.readers[argument].read(argument, value)
            for argument, value in received.items()
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
                "items": object_schema(
                    {"tool": {"type": "string"}, "arguments": {"type": "object"}}, ["tool"]
                ),
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
    """Return the actions of some groups as tools for models.

    Args:
        groups: names from `ALL_GROUPS`.

    Returns:
        The definitions, group by group in the order asked for.

    Raises:
        ValueError: a group that does not exist.
    """
    selected = tuple(groups)
    for group in selected:
        if group not in ALL_GROUPS:
            choices = ", ".join(ALL_GROUPS)
            raise ValueError(f"unknown group {group!r}; valid groups: {choices}")
    definitions = [*(action.definition for action in ACTIONS.values()), BATCH]
    return tuple(tool for group in selected for tool in definitions if tool.group == group)


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
    texts = {name: {"description": about[name]} if name in _EXPLAINED else {} for name in arguments}
    schema = object_schema(
        {name: readers[name].schema | texts[name] for name in arguments}, required
    )
    definition = ToolDefinition(
        name=propose.__name__, description=description, parameters=schema, group=group
    )
    return Action(definition=definition, propose=propose, readers=readers, required=required)


def _parameter(hint: object) -> Parameter:
    """Return an argument's annotated parameter; see `buildarena_geometry.actions.parameters`."""
    (parameter,) = (note for note in get_args(hint) if isinstance(note, Parameter))
    return parameter


def _parse_docstring(text: str) -> tuple[str, dict[str, str]]:
    """Parse a Google style docstring into description and arguments' texts, each on one line."""
    head, _, arguments = text.partition("Args:\n")
    about: dict[str, str] = {}
    for line in inspect.cleandoc(arguments).splitlines():
        if line.startswith(" "):
            about[list(about)[-1]] += " " + line.strip()
        else:
            name, _, meaning = line.partition(": ")
            about[name] = meaning
    return " ".join(head.split()), about


def _proposers(module: ModuleType) -> Iterator[Callable[..., Change]]:
    """Yield the actions of a module: its public functions that propose a change."""
    for function in filter(inspect.isfunction, vars(module).values()):
        if function.__annotations__.get("return") is Change and not function.__name__.startswith(
            "_"
        ):
            yield function


_MODULES: Mapping[str, ModuleType] = {
    "build": build,
    "refine": refine,
    "assemble": assemble,
    "control": control,
    "query": query,
    LOOKUP: catalogue,
    PROGRAM: program,
}
ACTIONS: Mapping[str, Action] = {
    propose.__name__: _action(propose, group)
    for group, module in _MODULES.items()
    for propose in _proposers(module)
}
_NAMES = CaselessNames(ACTIONS)


def is_batch(written: object) -> bool:
    """Check if a name means `build`, in any case."""
    return isinstance(written, str) and written.strip().casefold() == BATCH.name


def find_action(written: str) -> Action | None:
    """Return the action of a name, ignoring case; None if it is unknown."""
    name = _NAMES.find(written)
    return None if name is None else ACTIONS[name]
