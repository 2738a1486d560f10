"""Build machines and try them, in a notebook or a program, without a server.

Nothing heavy is loaded before it is used: ``import buildarena`` takes milliseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from buildarena.known_tasks import tasks
    from buildarena.machines import Feedback, Machine
    from buildarena.service import job_machine, job_trial, jobs, leaderboard
    from buildarena.trials import Trial, simulate, simulate_all

    __version__: str

_PLACES: Final = {
    "Feedback": "machines",
    "Machine": "machines",
    "Trial": "trials",
    "job_machine": "service",
    "job_trial": "service",
    "jobs": "service",
    "leaderboard": "service",
    "simulate": "trials",
    "simulate_all": "trials",
    "tasks": "known_tasks",
}
"""In which module each name is."""

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


def __getattr__(name: str) -> Any:
    """Loads what is asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _PLACES:
        raise AttributeError(f"module 'buildarena' has no {name!r}; it has {', '.join(_PLACES)}")
    attribute = getattr(import_module(f"buildarena.{_PLACES[name]}"), name)
    globals()[name] = attribute
    return attribute


def __dir__() -> list[str]:
    """The names that can be asked for."""
    return list(__all__)
