"""When a test runs: in `make test` without a mark, in CI with `ci`, in the night with `nightly`.

A rule has a case without a mark wherever one takes a second on a bare machine. PyBullet shows a
rule once, in CI; what it shows beyond, and further variants of what others show, is nightly.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def nightly(*values: Any, id: str | None = None) -> Any:  # noqa: A002 - pytest's name
    """Makes a variant of a parametrized test that runs in the night alone."""
    return pytest.param(*values, id=id, marks=pytest.mark.nightly)


def mark_variants(items: Iterable[pytest.Item]) -> None:
    """Marks variants of parametrized tests.

    ``nightly(keep=3)`` at a test leaves three of its variants, spread over all, as they are; with
    ``nightly(engine="pybullet")`` those on that engine are nightly, every one. Of any other test,
    the first variant on PyBullet is for CI and the rest are nightly.
    """
    variants: dict[str, list[pytest.Item]] = {}
    for item in items:
        variants.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for group in variants.values():
        _mark_group(group)


def _mark_group(group: Sequence[pytest.Item]) -> None:
    options = [mark for mark in group[0].iter_markers("nightly") if mark.kwargs]
    for item in group:
        item.own_markers = [mark for mark in item.own_markers if mark not in options]
    given = {name: value for mark in options for name, value in mark.kwargs.items()}
    open_ones = [item for item in group if not item.get_closest_marker("nightly")]
    on_pybullet = [item for item in open_ones if _engine(item) == "pybullet"]
    others = [item for item in open_ones if _engine(item) != "pybullet"]
    if "keep" in given:
        _keep(others or on_pybullet, given["keep"])
    in_ci = 0 if given.get("engine") == "pybullet" else 1
    for number, item in enumerate(on_pybullet):
        item.add_marker("ci" if number < in_ci else "nightly")


def _keep(group: Sequence[pytest.Item], most: int) -> None:
    kept = {round(number * len(group) / most) for number in range(most)}
    for number, item in enumerate(group):
        if number not in kept:
            item.add_marker("nightly")


def _engine(item: pytest.Item) -> Any:
    callspec = getattr(item, "callspec", None)
    return callspec.params.get("engine") if callspec else None
