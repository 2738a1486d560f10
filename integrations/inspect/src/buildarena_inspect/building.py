"""What one sample builds: its environment, and the calls that were made to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Self

import anyio
from inspect_ai.solver import TaskState

from buildarena_benchmark.environment import (
    ASSEMBLY,
    DEFAULT_STEPS,
    MAIN,
    Environment,
    EpisodeOverError,
    Limits,
    Submission,
    Trial,
    Workbench,
    counted_trial,
)
from buildarena_geometry import Machine
from buildarena_inspect.errors import LogError
from buildarena_inspect.trial_processes import try_machine
from buildarena_simulation import DEFAULT_ENGINE

STATE: Final = "buildarena:state"
"""Where a sample's store keeps how its episode stood when it was scored."""
CALLS: Final = "buildarena:calls"
"""Where a sample's store keeps the calls it made, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What a sample is played under; kept as its metadata.

    Attributes:
        task: Name of the task.
        simulator: Name of the engine.
        seed: Varies the start as a fair repetition would; None for the exact one.
        rounds: How often a model may submit.
        steps: Calls that it may make.
        rewards: Weights of rewards by name; None for none but success.
    """

    task: str
    simulator: str = DEFAULT_ENGINE
    seed: int | None = None
    rounds: int = 1
    steps: int = DEFAULT_STEPS
    rewards: Mapping[str, float] | None = None

    def environment(self) -> Environment:
        """The environment that they describe.

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
        """JSON values that `from_metadata` reads, with the version of the task."""
        task = self.environment().task
        return {**asdict(self), "task_version": task.version, "level": task.level}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> Self:
        """The conditions of a sample.

        Raises:
            LogError: Its metadata are not those of a sample of ours.
        """
        try:
            return cls(**{name: metadata[name] for name in cls.__slots__})
        except KeyError as missing:
            raise LogError(f"this is no sample of BuildArena: it has no {missing}") from missing


class Building:
    """The environment of one sample, with every call that reached it.

    Args:
        conditions: What it is played under.
    """

    def __init__(self, conditions: Conditions) -> None:
        self.conditions = conditions
        self.environment = conditions.environment()
        self.calls: list[dict[str, Any]] = []
        self._tried: list[Machine | None] = []
        self._submitting = anyio.Lock()

    @property
    def trial(self) -> Trial | None:
        """The trial that counts so far."""
        return self.environment.counted

    @property
    def machine(self) -> Machine | None:
        """The machine of the trial that counts so far, if there was one."""
        for trial, machine in zip(self.environment.trials, self._tried, strict=False):
            if trial is self.trial:
                return machine
        return None

    def call(self, tool: str, arguments: Mapping[str, Any]) -> str:
        """Carries out one action.

        Returns:
            What the model reads about it; of a refused one why, and what would be allowed.
        """
        given = dict(arguments)
        machine = given.pop("machine", MAIN)
        try:
            step = self.environment.step(tool, given, machine=machine)
        except EpisodeOverError as over:
            return str(over)
        self.calls.append({"machine": machine, "tool": tool, "arguments": given})
        return step.feedback

    async def submit(self) -> Submission:
        """Has what was built simulated and scored, beside the event loop.

        Raises:
            EpisodeOverError: The episode has ended.
            NothingToSubmitError: There is no machine, or there are several without an assembly.
            SimulationError: The engine failed or crashed.
        """
        return await self._tried_by(self.environment.submit)

    async def ended(self) -> Trial:
        """The trial that counts; what was never submitted is tried now.

        Raises:
            SimulationError: The engine failed or crashed.
        """
        if self.trial is None:
            await self._tried_by(self.environment.finish)
        found = self.trial
        assert found is not None  # noqa: S101 - an ended episode has a trial
        return found

    def adopt(self, machine: Machine | None, trial: Trial, *, handed_in: bool = True) -> None:
        """Takes over what a workflow of ours built and tried, as the end of the episode.

        The episode then holds the machine of the trial that counts, and the calls that make it.

        Args:
            machine: What it built, if anything.
            trial: Its trial.
            handed_in: Whether it was finished; what was not is no call of one who submits.
        """
        state = replace(self.environment.state(), done=True)
        state = replace(state, trials=(*state.trials, trial))
        if counted_trial(self.environment.task, state.trials) is trial:
            machines = {} if machine is None else {_name_of(machine): machine.logged}
            state = replace(state, machines=machines)
            self.calls = calls_of(machine) if handed_in else []
        self.environment.restore(state)
        self._tried.append(None if machine is None else machine.copy())

    async def _tried_by(self, submit: Callable[[], Submission]) -> Submission:
        async with self._submitting:
            done = await anyio.to_thread.run_sync(submit, limiter=anyio.CapacityLimiter(1))
        found = Workbench.holding(self.environment.machines).result()
        self._tried.append(None if found is None else found[1].copy())
        return done


def calls_of(machine: Machine | None) -> list[dict[str, Any]]:
    """The calls that one who builds alone would make for the same machine.

    A plan may call its sub-structures anything; here they are called part-1, part-2 and so on.
    """
    if machine is None:
        return []
    parts = machine.logged.available
    names = {name: f"part-{number}" for number, name in enumerate(parts, start=1)}
    calls = [
        {"machine": names[name], "tool": record.name, "arguments": record.arguments}
        for name, part in parts.items()
        for record in part.records
    ]
    for record in machine.logged.records:
        given = record.arguments
        if isinstance(given, Mapping) and given.get("machine_id") in names:
            given = {**given, "machine_id": names[str(given["machine_id"])]}
        calls.append({"machine": _name_of(machine), "tool": record.name, "arguments": given})
    return calls


def _name_of(machine: Machine) -> str:
    return ASSEMBLY if machine.logged.available else MAIN


_UNDER_WAY: dict[str, Building] = {}
"""By the id that a sample has once for each epoch and each try."""


def begin(state: TaskState) -> Building:
    """The building of a sample that begins, or begins again."""
    building = Building(Conditions.from_metadata(state.metadata))
    _UNDER_WAY[state.uuid] = building
    return building


def end(state: TaskState) -> None:
    """Forgets a sample's building."""
    _UNDER_WAY.pop(state.uuid, None)


def building_of(state: TaskState) -> Building:
    """The building of a sample under way, or of one that is scored again from its log.

    Raises:
        LogError: There is none, or it was built for another version of the task.
    """
    found = _UNDER_WAY.get(state.uuid)
    if found is not None:
        return found
    kept = state.store.get(STATE)
    if kept is None:
        raise LogError(f"sample {state.sample_id} has no building: it was never set up")
    conditions = Conditions.from_metadata(state.metadata)
    again = Building(conditions)
    version = again.environment.task.version
    if state.metadata["task_version"] != version:
        raise LogError(
            f"sample {state.sample_id} was built for {conditions.task} at version "
            f"{state.metadata['task_version']}, and this release has {version}"
        )
    # The trials are made again, so that scoring again means something.
    again.environment.restore({**kept, "trials": [], "done": False})
    again.calls = list(state.store.get(CALLS, []))
    return again
