"""BuildArena's tasks as an environment of verifiers: taskset, harness and environment."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_verifiers.environment import BuildEnv, load_environment
from buildarena_verifiers.harness import BuildHarness
from buildarena_verifiers.taskset import BuildTaskset

# verifiers finds the classes by these names.
__all__ = ["BuildEnv", "BuildHarness", "BuildTaskset", "load_environment"]
