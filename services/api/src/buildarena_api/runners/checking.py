"""Strangers' files are unpacked in a process apart: one that bursts it is refused."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, TypeVar

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_backend.artifacts.trajectory_files import OutcomeRefusedError
from buildarena_geometry import Machine
from buildarena_simulation import Scenario

T = TypeVar("T")
SPARE_BYTES: Final = 1 << 30
"""Memory for one file: that of the most block-seconds takes some 200 MB while it is read."""
LONGEST_S: Final = 30.0


class TrajectoryChecker:
    """Asks about trials, one question at a time."""

    def __init__(self) -> None:
        self._checker = Checker(
            "trajectories", _answering, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S
        )

    def ask(self, check: Callable[..., T], machine: Machine, scenario: Scenario, **more: Any) -> T:
        """What a check of a trial finds.

        Args:
            check: `checked_trajectory` or `require_refusable`.
            machine: The machine that was tried.
            scenario: What it was put through.
            more: What else the check is given.

        Raises:
            OutcomeRefusedError: It refuses, or can't tell within the bounds.
        """
        try:
            refusal, answer = self._checker.ask(
                (check, machine.to_document(), scenario.model_dump_json(), more)
            )
        except CheckFailedError as error:
            raise OutcomeRefusedError(str(error)) from error
        if refusal:
            raise OutcomeRefusedError(refusal)
        found: T = answer
        return found


@cache
def shared_checker() -> TrajectoryChecker:
    """This process' checker; its own process begins with the first file and ends with this one."""
    return TrajectoryChecker()


def _answering() -> Callable[[Any], tuple[str, Any]]:
    # Loaded before memory is limited.
    import pyarrow.parquet

    del pyarrow
    return _answer


def _answer(question: Any) -> tuple[str, Any]:
    check, machine, scenario, more = question
    try:
        return "", check(
            machine=Machine.from_document(machine),
            scenario=Scenario.model_validate_json(scenario),
            **more,
        )
    except OutcomeRefusedError as error:
        return str(error) or "it is refused", None
