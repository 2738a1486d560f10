"""Challenges: seasons as data, the packages that people hand in, their checks and scores."""

from __future__ import annotations

from buildarena_geometry import kernels  # noqa: F401 - before numpy
