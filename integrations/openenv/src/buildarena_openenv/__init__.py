"""BuildArena's tasks as an OpenEnv server and client; importing this package starts neither."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_openenv.client import BuildClient
from buildarena_openenv.models import BuildAction, BuildObservation, BuildState

__all__ = ["BuildAction", "BuildClient", "BuildObservation", "BuildState"]
