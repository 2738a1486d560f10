"""Categories of tasks: the folders in `tasks/` that have a `category.yaml`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Final

import yaml

TASKS: Final = "buildarena_benchmark.tasks"
"""The package that they are in. It reads this module, so it is known here by its name alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Category:
    """A folder of tasks that are judged alike.

    Attributes:
        name: Name of the folder, which its tasks state as their category.
        folder: Holds the task files, `expert.py` and the scorers that no other category has.
        paper: Names of its tasks that are the paper's.
        references: The built-in expert's indicators on MuJoCo, by task.
    """

    name: str
    title: str
    order: int
    folder: Path
    paper: tuple[str, ...] = ()
    references: Mapping[str, float] = field(default_factory=dict)

    @property
    def package(self) -> str:
        """Name of the Python package that the folder is."""
        return f"{TASKS}.{self.name}"


@cache
def categories() -> tuple[Category, ...]:
    """Return all categories in their order."""
    files = [
        file
        for path in import_module(TASKS).__path__
        for file in Path(path).glob("*/category.yaml")
    ]
    loaded = [
        Category(name=file.parent.name, folder=file.parent, **yaml.safe_load(file.read_text()))
        for file in files
    ]
    return tuple(sorted(loaded, key=lambda category: (category.order, category.name)))


def title_of(name: str) -> str:
    """Return what people call a category; its name in words where it has no folder."""
    titles = {category.name: category.title for category in categories()}
    return titles.get(name) or name.replace("-", " ").capitalize()
