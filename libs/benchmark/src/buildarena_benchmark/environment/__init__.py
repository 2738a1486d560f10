"""Building tasks as environments: steps, rewards, snapshots, and trials over processes.

Importing this package loads no engine; the first trial does.
"""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_benchmark import references
from buildarena_benchmark.environment.calls import LONGEST_CALL, Answer, call, call_text
from buildarena_benchmark.environment.environment import Environment
from buildarena_benchmark.environment.episodes import (
    DEFAULT_STEPS,
    Limits,
    Observation,
    Step,
    Submission,
)
from buildarena_benchmark.environment.errors import (
    BuildarenaEnvironmentError,
    EpisodeOverError,
    NothingToSubmitError,
    SnapshotError,
    UnknownChoiceError,
)
from buildarena_benchmark.environment.rewards import REWARDS, Progress
from buildarena_benchmark.environment.snapshots import Snapshot
from buildarena_benchmark.environment.tools import ASSEMBLY, MAIN, tools_of_models
from buildarena_benchmark.environment.trials.evaluator import Evaluator
from buildarena_benchmark.environment.trials.trial_pool import TrialPool
from buildarena_benchmark.environment.trials.trials import Trial, counted_trial, try_machine
from buildarena_benchmark.environment.workbench import Workbench

__all__ = [
    "ASSEMBLY",
    "DEFAULT_STEPS",
    "LONGEST_CALL",
    "MAIN",
    "REWARDS",
    "Answer",
    "BuildarenaEnvironmentError",
    "Environment",
    "EpisodeOverError",
    "Evaluator",
    "Limits",
    "NothingToSubmitError",
    "Observation",
    "Progress",
    "Snapshot",
    "SnapshotError",
    "Step",
    "Submission",
    "Trial",
    "TrialPool",
    "UnknownChoiceError",
    "Workbench",
    "call",
    "call_text",
    "counted_trial",
    "references",
    "tools_of_models",
    "try_machine",
]
