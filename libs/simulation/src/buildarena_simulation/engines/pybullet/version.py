"""Version of PyBullet."""

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as distribution_version


def version() -> str:
    """Return the version of the PyBullet library."""
    try:
        return distribution_version("pybullet")
    except PackageNotFoundError:
        return distribution_version("pybullet-arm64")  # the same library with more wheels
