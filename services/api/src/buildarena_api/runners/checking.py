"""Strangers' files are unpacked in a process apart: one that bursts it is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

from buildarena_api.checking import Checker, CheckFailedError
from buildarena_geometry import KeyPress, Machine
from buildarena_pipeline.runtime.trajectory_files import OutcomeRefusedError
from buildarena_pipeline.runtime.trial_checks import checked_trajectory
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
        question = {
            "data": data,
            "simulator": simulator,
            "version": version,
            "machine": machine.to_document(),
            "scenario": scenario.model_dump_json(),
            "controls": controls,
            "seed": seed,
        }
        try:
            refusal, trajectory = self._checker.ask(question)
        except CheckFailedError as error:
            raise OutcomeRefusedError(str(error)) from error
        if trajectory is None:
            raise OutcomeRefusedError(refusal)
        checked: Trajectory = trajectory
        return checked


@cache
def shared_checker() -> TrajectoryChecker:
    """This process' checker; its own process begins with the first file and ends with this one."""
    return TrajectoryChecker()


def _answering() -> Callable[[Any], tuple[str, Trajectory | None]]:
    # Loaded before memory is limited.
    import pyarrow.parquet

    del pyarrow
    return _answer


def _answer(question: Any) -> tuple[str, Trajectory | None]:
    try:
        return "", checked_trajectory(
            question["data"],
            simulator=question["simulator"],
            version=question["version"],
            machine=Machine.from_document(question["machine"]),
            scenario=Scenario.model_validate_json(question["scenario"]),
            controls=question["controls"],
            seed=question["seed"],
        )
    except OutcomeRefusedError as error:
        return str(error), None
