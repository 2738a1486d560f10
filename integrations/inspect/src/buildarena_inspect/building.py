"""A sample's building: its environment, and the calls to it."""

from __future__ import annotations

import atexit
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any, Final, Self

import anyio
from inspect_ai.solver import TaskState

from buildarena_benchmark import Task
from buildarena_benchmark.environment import (
    ASSEMBLY,
    DEFAULT_STEPS,
    MAIN,
    Environment,
    EpisodeOverError,
    Limits,
    Submission,
    Trial,
    TrialPool,
    Workbench,
    counted_trial,
)
from buildarena_geometry import Machine
from buildarena_inspect.errors import LogError
from buildarena_simulation import DEFAULT_ENGINE, SimulationError

STATE: Final = "buildarena:state"
"""Key of the episode's state at scoring in a sample's store."""
CALLS: Final = "buildarena:calls"
"""Key of the calls, in order, in a sample's store."""
ATTEMPTS: Final = 2
"""A process may end by chance once; if it ends twice, the machine is considered the cause."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """Settings of a sample, stored as its metadata.

    Attributes:
        task: Name of the task.
        simulator: Name of the engine.
        seed: Seed of the perturbed start; None for the exact one.
        rounds: Maximum number of submissions.
        steps: Maximum number of calls.
        rewards: Weights of rewards by name; None for only success.
    """

    task: str
    simulator: str = DEFAULT_ENGINE
    seed: int | None = None
    rounds: int = 1
    steps: int = DEFAULT_STEPS
    rewards: Mapping[str, float] | None = None

    def environment(self) -> Environment:
        """Create the environment with these settings.

        Raises:
            UnknownChoiceError: Task, simulator or a reward does not exist.
            ValueError: A number is out of range.
        """
        return Environment(
            self.task,
            self.simulator,
            seed=self.seed,
            rounds=self.rounds,
            limits=Limits(steps=self.steps),
            rewards=self.rewards,
            tries=try_machine,
        )

    def as_metadata(self) -> dict[str, Any]:
        """Return JSON values for `from_metadata`, with the version of the task."""
        task = self.environment().task
        return {**asdict(self), "task_version": task.version, "level": task.level}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """Return the conditions of a sample.

        Raises:
            LogError: The metadata are not those of a BuildArena sample.
        """
        try:
            return cls(**{name: metadata[name] for name in cls.__slots__})
        except KeyError as missing:
            raise LogError(f"not a sample of BuildArena: its metadata lack {missing}") from missing


class Building:
    """The environment of one sample, with every call that reached it."""

    def __init__(self, conditions: Conditions) -> None:
        self.conditions = conditions
        self.environment = conditions.environment()
        self.calls: list[dict[str, Any]] = []
        self._tested: list[Machine | None] = []
        self._submitting = anyio.Lock()

    @property
    def trial(self) -> Trial | None:
        """Trial that counts so far."""
        return self.environment.counted

    @property
    def machine(self) -> Machine | None:
        """Machine of the trial that counts so far, if any."""
        for trial, machine in zip(self.environment.trials, self._tested, strict=False):
            if trial is self.trial:
                return machine
        return None

    def call(self, tool: str, arguments: Mapping[str, Any]) -> str:
        """Carry out one action.

        Returns:
            The feedback for the model; for a refused action the reason and allowed choices.
        """
        values = dict(arguments)
        machine = values.pop("machine", MAIN)
        try:
            step = self.environment.step(tool, values, machine=machine)
        except EpisodeOverError as over:
            return str(over)
        self.calls.append({"machine": machine, "tool": tool, "arguments": values})
        return step.feedback

    async def submit(self) -> Submission:
        """Simulate and score the machine, in another thread than the event loop's.

        Raises:
            EpisodeOverError: The episode has ended.
            NothingToSubmitError: No machine was built, or several without an assembly.
            SimulationError: The engine failed or crashed.
        """
        return await self._run_trial(self.environment.submit)

    async def ended(self) -> Trial:
        """Return the trial that counts; simulate a machine that was never submitted.

        Raises:
            SimulationError: The engine failed or crashed.
        """
        if self.trial is None:
            await self._run_trial(self.environment.finish)
        trial = self.trial
        assert trial is not None  # noqa: S101 - an ended episode has a trial
        return trial

    def adopt(self, machine: Machine | None, trial: Trial, *, submitted: bool = True) -> None:
        """End the episode with a machine and a trial of a BuildArena workflow.

        The episode then has the machine of the trial that counts, and the calls that build it.

        Args:
            machine: The workflow's machine, if any.
            submitted: Whether the machine was finished; otherwise the episode has no calls.
        """
        state = replace(self.environment.state(), done=True)
        state = replace(state, trials=(*state.trials, trial))
        if counted_trial(self.environment.task, state.trials) is trial:
            machines = {} if machine is None else {_name_of(machine): machine.log}
            state = replace(state, machines=machines)
            self.calls = calls_of(machine) if submitted else []
        self.environment.restore(state)
        self._tested.append(None if machine is None else machine.copy())

    async def _run_trial(self, submit: Callable[[], Submission]) -> Submission:
        async with self._submitting:
            done = await anyio.to_thread.run_sync(submit, limiter=anyio.CapacityLimiter(1))
        result = Workbench.holding(self.environment.machines).result()
        self._tested.append(None if result is None else result[1].copy())
        return done


def calls_of(machine: Machine | None) -> list[dict[str, Any]]:
    """Return the calls of a single builder for the same machine.

    Sub-structures, which a plan names freely, are named part-1, part-2 and so on.
    """
    if machine is None:
        return []
    parts = machine.log.available
    names = {name: f"part-{number}" for number, name in enumerate(parts, start=1)}
    calls = [
        {"machine": names[name], "tool": record.name, "arguments": record.arguments}
        for name, part in parts.items()
        for record in part.records
    ]
    for record in machine.log.records:
        values = record.arguments
        if isinstance(values, Mapping) and values.get("machine_id") in names:
            values = {**values, "machine_id": names[str(values["machine_id"])]}
        calls.append({"machine": _name_of(machine), "tool": record.name, "arguments": values})
    return calls


def _name_of(machine: Machine) -> str:
    return ASSEMBLY if machine.log.available else MAIN


_ACTIVE: dict[str, Building] = {}
"""Buildings by sample id, which differs for each epoch and attempt."""


def begin(state: TaskState) -> Building:
    """Create the building of a sample that starts or restarts."""
    building = Building(Conditions.from_metadata(state.metadata))
    _ACTIVE[state.uuid] = building
    return building


def end(state: TaskState) -> None:
    """Remove a sample's building."""
    _ACTIVE.pop(state.uuid, None)


def building_of(state: TaskState) -> Building:
    """Return the building of an active sample, or of one that is rescored from its log.

    Raises:
        LogError: The sample has none, or was built for another version of the task.
    """
    active = _ACTIVE.get(state.uuid)
    if active is not None:
        return active
    stored = state.store.get(STATE)
    if stored is None:
        raise LogError(f"sample {state.sample_id} has no building: it was never set up")
    conditions = Conditions.from_metadata(state.metadata)
    building = Building(conditions)
    version = building.environment.task.version
    if state.metadata["task_version"] != version:
        raise LogError(
            f"sample {state.sample_id} was built for {conditions.task} at version "
            f"{state.metadata['task_version']}, and this release has {version}"
        )
    # Rescoring repeats the trials.
    building.environment.restore({**stored, "trials": [], "done": False})
    building.calls = list(state.store.get(CALLS, []))
    return building


def try_machine(
    task: Task, machine: Machine, simulator: str = DEFAULT_ENGINE, *, seed: int | None = None
) -> Trial:
    """Simulate a machine like the environment's `try_machine`, in a running process.

    Raises:
        SimulationError: The engine failed or ended its process.
    """
    for left in reversed(range(ATTEMPTS)):
        try:
            return _pool().try_machine(task, machine, simulator, seed=seed)
        except SimulationError as error:
            if not left:
                raise SimulationError(f"the machine could not be simulated: {error}") from error
    raise AssertionError("the last attempt returns or raises")


@cache
def _pool() -> TrialPool:
    """Return the pool of this process, which ends with it."""
    pool = TrialPool(trajectories=True)
    atexit.register(pool.close)
    return pool
