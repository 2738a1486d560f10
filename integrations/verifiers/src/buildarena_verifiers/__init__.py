"""BuildArena's tasks as an environment of verifiers: taskset, harness and environment."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_verifiers.environment import BuildEnv, BuildEnvConfig, load_environment
from buildarena_verifiers.harness import BuildHarness
from buildarena_verifiers.harness_config import BuildHarnessConfig
from buildarena_verifiers.taskset import (
    BuildData,
    BuildTask,
    BuildTaskConfig,
    BuildTaskset,
    BuildTasksetConfig,
)

__all__ = [
    "BuildData",
    "BuildEnv",
    "BuildEnvConfig",
    "BuildHarness",
    "BuildHarnessConfig",
    "BuildTask",
    "BuildTaskConfig",
    "BuildTaskset",
    "BuildTasksetConfig",
    "load_environment",
]
