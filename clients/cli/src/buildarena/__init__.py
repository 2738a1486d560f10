"""Build machines and try them, in a notebook or a program, without a server."""

from importlib.metadata import version

from buildarena.known_tasks import tasks
from buildarena.machines import Feedback, Machine
from buildarena.service import job_machine, job_trial, jobs, leaderboard
from buildarena.trials import Trial, simulate, simulate_all

__version__ = version("buildarena")

__all__ = [
    "Feedback",
    "Machine",
    "Trial",
    "__version__",
    "job_machine",
    "job_trial",
    "jobs",
    "leaderboard",
    "simulate",
    "simulate_all",
    "tasks",
]
