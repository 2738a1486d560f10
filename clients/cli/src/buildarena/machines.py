"""Machines in notebooks: each action is a method, and a machine is displayed in 3D."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from buildarena.pages import FRAME_HEIGHT, Shown
from buildarena_geometry import Machine as GeometryMachine
from buildarena_geometry import Outcome, Refused
from buildarena_geometry.tools import ACTIONS, Action


@dataclass(frozen=True, slots=True)
class Feedback:
    """Result of an action; shown as the text that a model reads.

    Attributes:
        ok: Whether the action was carried out; a refused one changed nothing.
        text: Text that a model reads.
        reason: Class of the refusal; None for an action that was carried out.
        changed: Ids of the parts that are new, different or gone.
    """

    ok: bool
    text: str
    reason: str | None = None
    changed: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text if self.ok else f"Refused ({self.reason}): {self.text}"


class Machine(GeometryMachine):
    """A machine that is built action by action; see `buildarena_geometry.Machine`.

    Every action of the geometry library is a method with the arguments that models give, and
    returns a `Feedback`. As the last line of a cell a machine is drawn in 3D, by a page that
    needs no server and no network.
    """

    __slots__ = ()

    def to_html(self, *, title: str = "A machine") -> str:
        """Return a self-contained page that shows the machine in 3D."""
        return self._display(title).page()

    def save_html(self, path: str | Path, *, title: str = "A machine") -> None:
        """Write that page into a file."""
        Path(path).write_text(self.to_html(title=title), encoding="utf-8")

    def _repr_mimebundle_(self, **_asked: Any) -> dict[str, str]:
        """Return the machine in 3D for notebooks, or its text where they show no HTML."""
        return {"text/plain": repr(self), "text/html": self._display("A machine").frame()}

    def _display(self, title: str) -> Shown:
        return Shown(title=title, machine=self, height=FRAME_HEIGHT)

    def __getattr__(self, name: str) -> Callable[..., Feedback]:
        """Raise an error that lists the actions."""
        # Notebooks look up many names for their display.
        if name.startswith("_"):
            raise AttributeError(name)
        raise AttributeError(f"unknown action {name!r}; valid actions: {', '.join(ACTIONS)}")


def _feedback(outcome: Outcome) -> Feedback:
    if isinstance(outcome, Refused):
        return Feedback(ok=False, text=outcome.text, reason=outcome.reason.value)
    return Feedback(ok=True, text=outcome.text, changed=outcome.changed)


def _method(action: Action) -> Callable[..., Feedback]:
    """Return an action as a method: its signature and docstring are those of the tool."""
    signature = _signature(action)

    def carry_out(self: Machine, *values: Any, **named: Any) -> Feedback:
        bound = signature.bind(self, *values, **named).arguments
        arguments = {name: value for name, value in bound.items() if name != "self"}
        return _feedback(self.act(action.definition.name, arguments))

    carry_out.__name__ = action.definition.name
    carry_out.__qualname__ = f"Machine.{action.definition.name}"
    carry_out.__doc__ = _docstring(action)
    carry_out.__signature__ = signature  # type: ignore[attr-defined] # functions have it
    return carry_out


def _signature(action: Action) -> inspect.Signature:
    usual = inspect.signature(action.propose).parameters
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters = [inspect.Parameter("self", kind)]
    parameters += [
        # Annotations also say how a model's argument is read.
        usual[name].replace(kind=kind, annotation=usual[name].annotation.__origin__)
        for name in action.definition.parameters["properties"]
    ]
    return inspect.Signature(parameters, return_annotation="Feedback")


def _docstring(action: Action) -> str:
    definition = action.definition
    lines = [definition.description]
    about = definition.parameters["properties"]
    if about:
        lines += ["", "Args:"]
        for name, schema in about.items():
            lines.append(f"    {name}: {schema.get('description', schema['type'])}")
    return "\n".join([*lines, "", "Returns:", "    What came of it, as a model reads it."])


for _name, _action in ACTIONS.items():
    setattr(Machine, _name, _method(_action))
