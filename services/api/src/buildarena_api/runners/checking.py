"""Strangers' files are unpacked in a process apart: one that bursts it is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_backend.artifacts.trajectory_files import OutcomeRefusedError
from buildarena_backend.trials.trial_checks import checked_trajectory, require_refusable
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Scenario, Trajectory

SPARE_BYTES: Final = 1 << 30
"""Memory for one file: that of the most block-seconds takes some 200 MB while it is read."""
LONGEST_S: Final = 30.0


class TrajectoryChecker:
    """Reads and checks trajectories, one at a time."""

    def __init__(self) -> None:
        self._checker = Checker(
            "trajectories", _answering, spare_bytes=SPARE_BYTES, longest_s=LONGEST_S
        )

    def checked(
        self,
        data: bytes,
        *,
        simulator: str,
        version: str,
        machine: Machine,
        scenario: Scenario,
        controls: Sequence[KeyPress] | None = None,
        seed: int | None = None,
    ) -> Trajectory:
        """The trajectory of a file; see `checked_trajectory`.

        Raises:
            OutcomeRefusedError: It is none of this trial, or can't be read within the bounds.
        """
        checked: Trajectory = self._asked(
            checked_trajectory,
            machine,
            scenario,
            data=data,
            simulator=simulator,
            version=version,
            controls=controls,
            seed=seed,
        )
        return checked

    def require_refusable(
        self,
        *,
        simulator: str,
        machine: Machine,
        scenario: Scenario,
        controls: Sequence[KeyPress] | None,
        versions: Mapping[str, Any],
        log: bytes | None,
    ) -> None:
        """Checks that a simulator would refuse a machine; see the function of this name.

        Raises:
            OutcomeRefusedError: It would not, or that can't be told within the bounds.
        """
        self._asked(
            require_refusable,
            machine,
            scenario,
            simulator=simulator,
            controls=controls,
            versions=dict(versions),
            log=log,
        )

    def _asked(
        self, check: Callable[..., Any], machine: Machine, scenario: Scenario, **more: Any
    ) -> Any:
        try:
            refusal, answer = self._checker.ask(
                (check, machine.to_document(), scenario.model_dump_json(), more)
            )
        except CheckFailedError as error:
            raise OutcomeRefusedError(str(error)) from error
        if refusal:
            raise OutcomeRefusedError(refusal)
        return answer


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
