"""Groups of commands that are loaded when they are named.

Loading every command takes half a second and more; help and completion need their names and first
sentences only, which are in `buildarena_cli.command_table`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from importlib import import_module
from typing import Any, ClassVar

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group

from buildarena_cli.command_table import ADMIN, GROUPS, Entry
from buildarena_cli.suggestions import suggested_words

MAX_WIDTH = 100
"""Columns of help texts on wide terminals."""
CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": MAX_WIDTH}


class SuggestingGroup(TyperGroup):
    """A group whose refusal of an unknown command names the near ones."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first word names; click's signature."""
        self.suggest_commands = False
        try:
            return super().resolve_command(ctx, args)
        except Exception as error:
            near = suggested_words(args[0], self.commands)
            if ctx.parent is None and args[0] in ADMIN:
                near = [f"admin {args[0]}"]
            if near and getattr(error, "message", "").startswith("No such command"):
                error.message = (  # type: ignore[attr-defined]
                    f"No such command {args[0]!r}; did you mean {' or '.join(near)}?"
                )
            raise


class LazyGroup(SuggestingGroup):
    """The group of all commands."""

    groups: ClassVar[Mapping[str, Mapping[str, Entry]]] = GROUPS

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._entries = {
            name: entry for each in self.groups.values() for name, entry in each.items()
        }
        self.commands = _Commands(self._entries)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - click's
        """Writes the commands' names and first sentences, without loading them."""
        for title, entries in self.groups.items():
            with formatter.section(title):
                formatter.write_dl([(name, entry.help) for name, entry in entries.items()])

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """What the shell offers for the first word."""
        from typer.core import CompletionItem  # type: ignore[attr-defined] # typer has no other

        if incomplete.startswith("-"):
            return super(TyperGroup, self).shell_complete(ctx, incomplete)
        return [
            CompletionItem(name, help=entry.help)
            for name, entry in self._entries.items()
            if name.startswith(incomplete)
        ]


class AdminGroup(LazyGroup):
    """The group of operators' commands."""

    groups: ClassVar[Mapping[str, Mapping[str, Entry]]] = {"Commands": ADMIN}


class _Commands(MutableMapping[str, Any]):
    """The commands by name; one is loaded when it is asked for."""

    def __init__(self, entries: Mapping[str, Entry]) -> None:
        self._entries = entries
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            self._loaded[name] = _load(name, self._entries[name])
        return self._loaded[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._loaded[name] = command

    def __delitem__(self, name: str) -> None:
        del self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def new_group(text: str, cls: type[TyperGroup] = SuggestingGroup) -> typer.Typer:
    """An empty group of commands.

    Args:
        text: What they are for.
        cls: What finds them.
    """
    return typer.Typer(
        help=text,
        no_args_is_help=True,
        cls=cls,
        rich_markup_mode=None,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings=CONTEXT,
    )


def _load(name: str, entry: Entry) -> Any:
    target = getattr(import_module(f"buildarena_cli.commands.{entry.module}"), entry.attribute)
    if isinstance(target, typer.Typer):
        group = get_group(target)
        group.name = name
        return group
    alone = typer.Typer(rich_markup_mode=None, add_completion=False, pretty_exceptions_enable=False)
    alone.command(name, context_settings=CONTEXT)(target)
    return get_command(alone)
