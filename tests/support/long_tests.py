"""What `make test` leaves to `make test-long`: further variants of what it tries already.

A variant is long when another of the same test stays in `make test`: no rule is without one.
"""

import os
from typing import Any, Final

import pytest

LONG: Final = bool(os.environ.get("BUILDARENA_TEST_LONG"))
"""Whether `make test-long` runs; sizes may hang on it."""


def long(*values: Any, id: str | None = None) -> Any:  # noqa: A002 - pytest's name
    """A variant for `make test-long` alone."""
    return pytest.param(*values, id=id, marks=pytest.mark.long)


slow_on_pybullet: Final = pytest.mark.parametrize(
    "engine", ["mujoco", long("pybullet")], indirect=True
)
"""A rule that MuJoCo shows in seconds; PyBullet takes several times as long."""
