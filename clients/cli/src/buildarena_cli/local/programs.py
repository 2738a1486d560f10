"""The programs of a service, other than its servers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from buildarena_backend.states import CONSTRUCT_QUEUE, simulate_queue


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """A program of the service.

    Attributes:
        arguments: Module and arguments, for ``python -m``.
        queue: Queue that the program serves; None for the API.
    """

    name: str
    arguments: Sequence[str]
    queue: str | None = None


def programs(simulators: Iterable[str]) -> list[Program]:
    """Return all programs in the order in which they are started.

    Args:
        simulators: Simulators to have a worker for.
    """
    return [
        Program(name="api", arguments=["buildarena_api"]),
        Program(name="construct worker", arguments=["buildarena_worker"], queue=CONSTRUCT_QUEUE),
        *(
            Program(
                name=f"{simulator} worker",
                arguments=["buildarena_simworker", "--simulator", simulator],
                queue=simulate_queue(simulator),
            )
            for simulator in simulators
        ),
    ]
