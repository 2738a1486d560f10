"""Repetition of a trial, by an engine or from the game's log.

Trials from other kinds of processors are repeated with the kernels used there.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from typing import Any, Final

from buildarena_backend.artifacts.store import ArtifactStore
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.annotations import annotate
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Task, failed_score, score
from buildarena_benchmark.environment.other_kernels import simulate_with
from buildarena_benchmark.scores import simulate_task
from buildarena_besiege import (
    LogIncompleteError,
    MachineNotPlayableError,
    logged_trajectory,
    prepare_run,
)
from buildarena_geometry import Machine, kernels
from buildarena_geometry.machine_files import machine_bytes
from buildarena_simulation import (
    SIMULATION_VERSION,
    ControllerFailed,
    MachineNotSimulable,
    Trajectory,
    TrajectoryFormatError,
    UnknownEngineError,
    engine_version,
    processor,
    schema_of,
    write_trajectory,
)
from buildarena_worker.session.host import Setup
from buildarena_worker.verify.report import SCORED, Check, failure_checks, plain

PROCESSOR: Final = "processor"
"""Key of a rollout's versions for the simulating processor, see `buildarena_simulation`."""
_LEVELS: Final = {"SkylakeX": "X86_V4", "Haswell": "X86_V3"}
_LOWEST: Final = "X86_V2"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialVerifier:
    """Verifier of one job's trials.

    Attributes:
        files: Hashes of the job's artifacts by name.
    """

    task: Task
    artifacts: ArtifactStore
    files: Mapping[str, str]

    def checks(self, record: RolloutRecord, setup: Setup) -> list[Check]:
        """Repeat a machine's trial, and compare it with the stored one.

        Raises:
            ArtifactMissingError: The trajectory or the log is missing.
            ArtifactDamagedError: Other bytes are stored in its place.
        """
        machine, name = setup[0], f"rollout {record.number}"
        built = digest_of(machine_bytes(machine))
        checks = [Check(f"{name}: machine", record.machine_hash, built)]
        # A different machine moves differently in any case.
        trial = record.number if built == record.machine_hash else None
        stored_bytes = (
            None if record.trajectory_hash is None else self.artifacts.get(record.trajectory_hash)
        )
        kernels = trajectory = None
        failure = ""
        try:
            if record.engine == BESIEGE:
                checks += self._annotation_checks(name, record, setup)
                trajectory = self._played(record, machine)
            else:
                checks += _version_checks(name, record)
                kernels, trajectory = self._repeat(record, setup, stored_bytes)
        except LogIncompleteError as error:
            return [*checks, Check(f"{name}: log", "", str(error), able=False)]
        except UnknownEngineError as error:
            return [*checks, Check(f"{name}: engine", record.engine, str(error), able=False)]
        except (MachineNotSimulable, MachineNotPlayableError) as error:
            repeated, digest = failed_score(self.task, machine), None
            if isinstance(error, ControllerFailed):
                failure = str(error)
                kernels = None if record.engine == BESIEGE else kernels_for(record)[0]
        else:
            repeated = score(self.task, machine, trajectory)
            digest = digest_of(_write_like(stored_bytes, trajectory))
        outcomes = [
            Check(f"{name}: trajectory", record.trajectory_hash, digest, trial=trial),
            *failure_checks(name, record.versions or {}, failure, trial),
        ]
        checks += outcomes
        if kernels is not None and not all(check.ok for check in outcomes):
            checks += _processor_checks(name, record, kernels)
        for field in SCORED:
            stored = plain(getattr(record, field))
            checks.append(Check(f"{name}: {field}", stored, plain(getattr(repeated, field))))
        return checks

    def _annotation_checks(self, name: str, record: RolloutRecord, setup: Setup) -> list[Check]:
        """Check engines' annotations of a game trial, if their versions are the same."""
        machine, controls = setup
        computed = annotate(self.task, machine, None if controls is None else tuple(controls))
        return [
            Check(f"{name}: annotation by {engine}", stored, plain(computed[engine]))
            for engine, stored in (record.annotations or {}).items()
            if engine in computed
            and all(stored[k] == computed[engine][k] for k in ("simulation", "engine_version"))
        ]

    def _played(self, record: RolloutRecord, machine: Machine) -> Trajectory:
        """Return the trial in a stored log of the game, which is not started again.

        Raises:
            LogIncompleteError: The log is missing or incomplete.
            MachineNotPlayableError: The game can't load the machine, so there was no log.
        """
        digest = self.files.get(f"log-{record.number}.txt")
        if digest is None:
            prepare_run(machine, self.task.scenario, name="again", run_id="again")
            raise LogIncompleteError("the log of the trial was not stored")
        text = self.artifacts.get(digest).decode("utf-8", "replace")
        return logged_trajectory(text, record.versions or {}, machine, self.task.scenario)

    def _repeat(
        self, record: RolloutRecord, setup: Setup, stored_bytes: bytes | None
    ) -> tuple[str, Trajectory]:
        """Return kernels and trajectory of the first repetition with equal bytes, or the first.

        Raises:
            BuildarenaSimulationError: See `buildarena_simulation.simulate`.
        """
        first = None
        for kernel_set in kernels_for(record):
            is_own = kernel_set == processor()["blas"]
            run = simulate_task if is_own else partial(simulate_with, kernel_set)
            machine, controls = setup
            trajectory = run(self.task, machine, record.engine, controls=controls, seed=record.seed)
            if _write_like(stored_bytes, trajectory) == stored_bytes:
                return kernel_set, trajectory
            first = first or (kernel_set, trajectory)
        assert first is not None, "a trial is repeated with one kind of kernels at least"  # noqa: S101 - ours
        return first


def digest_of(data: bytes) -> str:
    """Return the hash by which bytes are stored."""
    return sha256(data).hexdigest()


def _version_checks(name: str, record: RolloutRecord) -> list[Check]:
    """Compare the versions that simulated a trajectory with those here."""
    stored = record.versions or {}
    current = {"simulation": SIMULATION_VERSION, "engine_version": engine_version(record.engine)}
    return [
        Check(f"{name}: {key.replace('_', ' ')}", stored.get(key), version, able=False)
        for key, version in current.items()
    ]


def _write_like(stored_bytes: bytes | None, trajectory: Trajectory) -> bytes:
    """Return a trajectory's file in the schema of the stored one, which may be older."""
    with suppress(TrajectoryFormatError, ValueError):
        if stored_bytes is not None:
            return write_trajectory(trajectory, schema=schema_of(stored_bytes))
    return write_trajectory(trajectory)


def _processor_checks(name: str, record: RolloutRecord, kernels: str) -> list[Check]:
    """Check whether another processor may explain differing bytes, which is inconclusive."""
    stored, current = processor_of(record), processor_with(kernels)
    # A runner must not profit from leaving out its processor.
    if stored == current or (stored is None and record.runner is not None):
        return []
    return [Check(f"{name}: processor", stored and dict(stored), dict(current), able=False)]


def processor_of(record: RolloutRecord) -> Mapping[str, Any] | None:
    """Return the processor in a rollout's versions, if any; a runner may send anything."""
    named = (record.versions or {}).get(PROCESSOR)
    return named if isinstance(named, Mapping) else None


def kernels_for(record: RolloutRecord) -> list[str]:
    """Return the kernels to repeat a trial with: those it names, if this processor has them.

    A worker's result that names none is repeated with all, this process's first. A runner's is not,
    so that false results do not multiply the cost of verification.
    """
    own, then = processor()["blas"], processor_of(record)
    if then is None:
        alternatives = [name for name in kernels.runnable() if name != own]
        return [own, *alternatives] if record.runner is None else [own]
    named = then.get("blas")
    return [named if named in kernels.runnable() else own]


def processor_with(name: str) -> Mapping[str, str]:
    """Return this processor with some kernels, in the form of manifests."""
    own = processor()
    return (
        own if name == own["blas"] else {**own, "blas": name, "numpy": _LEVELS.get(name, _LOWEST)}
    )
