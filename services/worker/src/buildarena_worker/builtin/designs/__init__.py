"""Parametric designs of our own for the built-in tasks; docs/expert.md explains them."""

from __future__ import annotations

from collections.abc import Callable

from buildarena_worker.builtin.designs.bridges import bridge
from buildarena_worker.builtin.designs.design import Design

DESIGNS: dict[str, Callable[[int], Design]] = {
    "support-1": lambda seed: bridge(seed, gap=5),
}
"""By task name: the design for a seed, which varies it within its tolerances."""

__all__ = ["DESIGNS", "Design"]
