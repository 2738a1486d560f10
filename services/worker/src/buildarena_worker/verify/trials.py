"""A trial made again: by our engines, or from the game's log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256

from buildarena_backend.artifacts.storing import ArtifactStore
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.annotations import annotate
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Task, failed_score, score
from buildarena_besiege import (
    LogIncompleteError,
    MachineNotPlayableError,
    logged_trajectory,
    prepare_run,
)
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import (
    SIMULATION_VERSION,
    ControllerFailed,
    MachineNotSimulable,
    Trajectory,
    TrajectoryFormatError,
    UnknownEngineError,
    engine_version,
    read_trajectory,
    schema_of,
    write_trajectory,
)
from buildarena_worker.verify.processors import (
    apart,
    kernels_for,
    named_processor,
    processor_with,
    simulated,
)
from buildarena_worker.verify.report import SCORED, Check, compare, failure_checks, plain

Tried = tuple[Machine, Sequence[KeyPress] | None]
"""A machine, and the key presses of its trial; None for its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialVerifier:
    """Makes the trials of one job again.

    Attributes:
        task: What machines are put through.
        artifacts: Where kept trajectories and logs are.
        files: Hashes of the job's artifacts by name.
    """

    task: Task
    artifacts: ArtifactStore
    files: Mapping[str, str]

    def checks(self, record: RolloutRecord, tried: Tried) -> list[Check]:
        """Return whether a machine, tried again, does what is stored of its trial.

        Raises:
            ArtifactMissingError: The trajectory or the log is gone.
            ArtifactDamagedError: Other bytes are stored in its place.
        """
        machine, name = tried[0], f"rollout {record.number}"
        built = digest_of(machine_bytes(machine))
        checks = [compare(f"{name}: machine", record.machine_hash, built)]
        # Another machine moves otherwise, whoever simulates it.
        trial = record.number if built == record.machine_hash else None
        kept = (
            None if record.trajectory_hash is None else self.artifacts.get(record.trajectory_hash)
        )
        kernels = trajectory = None
        failure = ""
        try:
            if record.engine == BESIEGE:
                checks += self._annotation_checks(name, record, tried)
                trajectory = self._played(record, machine)
            else:
                checks += _version_checks(name, record)
                kernels, trajectory = self._repeated(record, tried, kept)
        except LogIncompleteError as error:
            return [*checks, compare(f"{name}: log", "", str(error), able=False)]
        except UnknownEngineError as error:
            return [*checks, compare(f"{name}: engine", record.engine, str(error), able=False)]
        except (MachineNotSimulable, MachineNotPlayableError) as error:
            repeated, digest = failed_score(self.task, machine), None
            if isinstance(error, ControllerFailed):
                failure = str(error)
                kernels = None if record.engine == BESIEGE else kernels_for(record)[0]
        else:
            repeated = score(self.task, machine, trajectory)
            digest = digest_of(_written_as(kept, trajectory))
        outcomes = [
            compare(f"{name}: trajectory", record.trajectory_hash, digest, trial=trial),
            *failure_checks(name, record.versions or {}, failure, trial),
        ]
        checks += outcomes
        if kernels is not None and not all(check.ok for check in outcomes):
            checks += _processor_checks(name, record, kernels, kept, trajectory)
        for field in SCORED:
            stored = plain(getattr(record, field))
            checks.append(compare(f"{name}: {field}", stored, plain(getattr(repeated, field))))
        return checks

    def _annotation_checks(self, name: str, record: RolloutRecord, tried: Tried) -> list[Check]:
        """Check our engines' annotations of a game trial, if their versions are the same."""
        machine, controls = tried
        said = annotate(self.task, machine, None if controls is None else tuple(controls))
        return [
            compare(f"{name}: what {engine} says", kept, plain(said[engine]))
            for engine, kept in (record.annotations or {}).items()
            if engine in said
            and all(kept[what] == said[engine][what] for what in ("simulation", "engine_version"))
        ]

    def _played(self, record: RolloutRecord, machine: Machine) -> Trajectory:
        """Return the trial in a stored log of the game; the game plays nothing again.

        Raises:
            LogIncompleteError: There is no log, or it does not tell enough.
            MachineNotPlayableError: The game takes no such machine, so there is no log.
        """
        digest = self.files.get(f"log-{record.number}.txt")
        if digest is None:
            prepare_run(machine, self.task.scenario, name="again", run_id="again")
            raise LogIncompleteError("the log of the trial was not kept")
        text = self.artifacts.get(digest).decode("utf-8", "replace")
        return logged_trajectory(text, record.versions or {}, machine, self.task.scenario)

    def _repeated(
        self, record: RolloutRecord, tried: Tried, kept: bytes | None
    ) -> tuple[str, Trajectory]:
        """Return kernels and trajectory of the first repetition with equal bytes, or the first."""
        first = None
        for kernels in kernels_for(record):
            trajectory = simulated(kernels, record, tried[0], self.task, tried[1])
            if _written_as(kept, trajectory) == kept:
                return kernels, trajectory
            first = first or (kernels, trajectory)
        assert first is not None, "a trial is repeated with one kind of kernels at least"  # noqa: S101 - ours
        return first


def digest_of(data: bytes) -> str:
    """Return the hash by which bytes are stored."""
    return sha256(data).hexdigest()


def _version_checks(name: str, record: RolloutRecord) -> list[Check]:
    """Return whether a trajectory came of the versions that simulate here."""
    said = record.versions or {}
    here = {"simulation": SIMULATION_VERSION, "engine_version": engine_version(record.engine)}
    return [
        compare(f"{name}: {what.replace('_', ' ')}", said.get(what), version, able=False)
        for what, version in here.items()
    ]


def _written_as(kept: bytes | None, trajectory: Trajectory) -> bytes:
    """Return a trajectory's file in the schema of the kept one, which an older version may have."""
    with suppress(TrajectoryFormatError, ValueError):
        if kept is not None:
            return write_trajectory(trajectory, schema=schema_of(kept))
    return write_trajectory(trajectory)


def _processor_checks(
    name: str,
    record: RolloutRecord,
    kernels: str,
    kept: bytes | None,
    trajectory: Trajectory | None,
) -> list[Check]:
    """Check whether another processor may explain differing bytes, which is inconclusive."""
    then, here = named_processor(record), processor_with(kernels)
    # A runner that names no processor gains nothing by it.
    if then == here or (then is None and record.runner is not None):
        return []
    told = dict(here)
    with suppress(TrajectoryFormatError, ValueError):
        if kept is not None and trajectory is not None:
            told |= apart(read_trajectory(kept), trajectory)
    return [compare(f"{name}: processor", then and dict(then), told, able=False)]
