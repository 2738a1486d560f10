"""The expert's machines: each category's `expert.py` has a design for each of its tasks."""

from collections.abc import Callable
from functools import cache
from importlib import import_module

from buildarena_benchmark.categories import categories
from buildarena_benchmark.experts.design import Design, Designs


@cache
def expert_designs() -> Designs:
    """Return the expert's designs for all built-in tasks, by the task's name."""
    designs: dict[str, Callable[[int], Design]] = {}
    for category in categories():
        designs |= import_module(f"{category.package}.expert").DESIGNS
    return designs
