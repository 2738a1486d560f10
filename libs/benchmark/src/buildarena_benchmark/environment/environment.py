"""A building task as an environment: reset, step, submit, and back to any state."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from buildarena_benchmark import Task
from buildarena_benchmark.environment.briefing import (
    briefing,
    describe_trials,
    file_text,
    visible_catalogue,
)
from buildarena_benchmark.environment.episodes import Limits, Observation, Step, Submission
from buildarena_benchmark.environment.errors import (
    EpisodeOverError,
    NothingToSubmitError,
    SnapshotError,
)
from buildarena_benchmark.environment.options import checked_simulator, reference_of, resolve_task
from buildarena_benchmark.environment.rewards import (
    DEFAULT_WEIGHTS,
    REWARDS,
    TERMINAL,
    Progress,
    checked_weights,
    weighed,
)
from buildarena_benchmark.environment.snapshots import Snapshot
from buildarena_benchmark.environment.tools import MAIN, tools_of_models
from buildarena_benchmark.environment.trials.trials import (
    Trial,
    TrialRunner,
    counted_trial,
    score_text,
    try_machine,
)
from buildarena_benchmark.environment.workbench import Workbench
from buildarena_geometry import Accepted, Cause, Machine, Outcome, Refused, ToolDefinition
from buildarena_simulation import DEFAULT_ENGINE

LAST: Final = "This ends the episode."
AGAIN: Final = "After each trial but the last you read the measurements and may continue."


class Environment:
    """A task that is played by steps. The same task, seed and steps give the same results.

    Args:
        task: The task, or the name of a built-in one.
        simulator: Name of the engine for trials.
        seed: Varies the start of machine and cargo, as a fair repetition would, and samples hidden
            numbers; None for the exact start of the service, and the numbers of seed 0.
        rounds: Number of submissions; a successful trial ends the episode. A task with test trials
            allows one submission more than those, whatever is passed: only the last one counts and
            ends it.
        rewards: Weights by the names in `REWARDS`; success alone by default.
        reference: The indicator that is worth 1; the task's reference where there is one.
        tries: Runs the trials, such as a `TrialPool`'s `try_machine`; by default this process.
        data_sheets: Whether the builder receives the numbers of modules and world, or must test
            for them.

    Raises:
        UnknownChoiceError: Task, simulator or a reward does not exist.
        ValueError: A number is out of range.
    """

    def __init__(
        self,
        task: Task | str,
        simulator: str = DEFAULT_ENGINE,
        *,
        seed: int | None = None,
        rounds: int = 1,
        limits: Limits | None = None,
        rewards: Mapping[str, float] | None = None,
        reference: float | None = None,
        tries: TrialRunner = try_machine,
        data_sheets: bool = True,
    ) -> None:
        if rounds < 1:
            raise ValueError(f"rounds is {rounds}: a builder submits at least once")
        self.task = resolve_task(task).with_seed(seed or 0)
        self.simulator = checked_simulator(simulator)
        self.seed = seed
        self.rounds = self.task.test_trials + 1 if self.task.test_trials else rounds
        self.limits = limits or Limits()
        self.weights = checked_weights(DEFAULT_WEIGHTS if rewards is None else rewards)
        self.reference = reference_of(self.task, reference, needed="indicator" in self.weights)
        self.data_sheets = data_sheets
        self._tries = tries
        self._shaped = bool(self.weights.keys() - TERMINAL)
        self._bench = self._new_bench()
        self._steps = self._changes = self._refused = 0
        self._trials: tuple[Trial, ...] = ()
        self._done = False
        self._reward = self._worth()

    def reset(self, *, seed: int | None = None) -> Observation:
        """Begin an episode.

        Args:
            seed: Replaces the environment's, if given.
        """
        if seed is not None:
            self.seed = seed
            self.task = self.task.with_seed(seed)
            self._bench = self._new_bench()
        self._go_to(Snapshot(task=self.task.name, task_version=self.task.version))
        return self.observation

    @property
    def observation(self) -> Observation:
        """First observation of a builder."""
        text = briefing(
            self.task,
            trials=describe_trials(self.task, self.rounds),
            guidelines=file_text("guidelines.md"),
            values={
                "calls": f"{self.limits.steps:,}",
                "after": LAST if self.rounds == 1 else AGAIN,
            },
            data_sheets=self.data_sheets,
        )
        return Observation(task=self.task.name, briefing=text, tools=self.tools)

    @property
    def tools(self) -> tuple[ToolDefinition, ...]:
        """Tools of a builder in this task, the submission included."""
        return tools_of_models(self.task)

    @property
    def machines(self) -> Mapping[str, Machine]:
        """Machines built so far, by name."""
        return self._bench.machines

    def submitted(self) -> Machine:
        """Return the machine that a submission would try now.

        Raises:
            NothingToSubmitError: No machine exists, or several without an assembly.
        """
        return self._bench.submitted()

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The trials of this episode, in order."""
        return self._trials

    @property
    def counted(self) -> Trial | None:
        """The trial that counts so far: the best, or the last where a task has test trials."""
        return counted_trial(self.task, self._trials) if self._trials else None

    @property
    def reward(self) -> float:
        """Reward of the episode so far."""
        return self._reward

    @property
    def named_rewards(self) -> Mapping[str, float]:
        """All rewards of the current state, by name and without weights."""
        progress = self._progress()
        return {name: reward(progress) for name, reward in REWARDS.items()}

    @property
    def done(self) -> bool:
        """True if the episode has ended."""
        return self._done

    @property
    def remaining_steps(self) -> int:
        """Steps that the episode may still have."""
        return 0 if self._done else self.limits.steps - self._steps

    def step(self, tool: object, arguments: Any = None, *, machine: str = MAIN) -> Step:
        """Carry out one action.

        Args:
            tool: The action's name; the machine stays valid for any value.
            arguments: Its arguments, JSON values by name.
            machine: Name of the machine; a new one if none has this name.

        Raises:
            EpisodeOverError: The episode has ended, or has no steps left.
        """
        self._require_a_step()
        return self._count_step(self._act(machine, tool, arguments))

    def refuse(self, reason: str) -> Step:
        """Count a step that names no action, as a refused one.

        Raises:
            EpisodeOverError: The episode has ended, or has no steps left.
        """
        self._require_a_step()
        return self._count_step(Refused(cause=Cause.MALFORMED_ARGUMENTS, text=reason))

    def _new_bench(self) -> Workbench:
        limits = self.task.constraints
        catalogue = visible_catalogue(limits, data_sheets=self.data_sheets)
        return Workbench(catalogue, on_demand=limits.on_demand, task=self.task)

    def _act(self, machine: str, tool: object, arguments: Any) -> Outcome:
        room = self.limits.parts
        if room is None:
            return self._bench.act(machine, tool, arguments)
        before = self._bench.values()
        outcome = self._bench.act(machine, tool, arguments)
        count = sum(machine.part_count for machine in self._bench.machines.values())
        if count <= room:
            return outcome
        self._bench.return_to(before)
        return Refused(
            cause=Cause.OUT_OF_RANGE,
            text=f"Your machines would have {count:,} parts together; there is room for {room:,}.",
        )

    def _require_a_step(self) -> None:
        if self._done:
            raise EpisodeOverError("the episode has ended: reset begins another")
        if self._steps >= self.limits.steps:
            raise EpisodeOverError(f"all {self.limits.steps:,} steps are used up: submit")

    def _count_step(self, outcome: Outcome) -> Step:
        self._steps += 1
        if not isinstance(outcome, Accepted):
            self._refused += 1
        elif outcome.changed:
            self._changes += 1
        if self._shaped:
            self._reward = self._worth()
        return Step(outcome, self._reward, truncated=self._steps >= self.limits.steps)

    def submit(self) -> Submission:
        """Have what was built simulated and scored.

        Raises:
            EpisodeOverError: The episode has ended.
            NothingToSubmitError: No machine exists, or several without an assembly; the
                message says what to do, and the episode continues.
            SimulationError: The simulator failed; the episode is unchanged.
        """
        return self._submit(counts=len(self._trials) >= self.task.test_trials)

    def _submit(self, *, counts: bool) -> Submission:
        if self._done:
            raise EpisodeOverError("the episode has ended: reset begins another")
        number = len(self._trials) + 1
        seed = self.seed if counts else self.task.test_seed(number, self.seed or 0)
        trial = self._tries(self.task, self.submitted(), self.simulator, seed=seed)
        self._trials = (*self._trials, trial)
        succeeded = trial.counts and not self.task.test_trials
        self._done = succeeded or len(self._trials) >= self.rounds
        self._reward = self._worth()
        report = trial.detail or score_text(self.task, trial.score, trial.trajectory)
        return Submission(trial=trial, reward=self._reward, report=report, done=self._done)

    def finish(self) -> Submission:
        """Submit what there is and end the episode; nothing to submit is a failure as well.

        Raises:
            EpisodeOverError: The episode has ended.
        """
        try:
            submitted = self._submit(counts=True)
        except NothingToSubmitError as nothing:
            empty = try_machine(self.task, Machine())
            trial = Trial(score=empty.score, reason="nothing_submitted", detail=str(nothing))
            self._trials = (*self._trials, trial)
            self._reward = self._worth()
            submitted = Submission(trial=trial, reward=self._reward, report=trial.detail, done=True)
        self._done = True
        return replace(submitted, done=True)

    def state(self) -> Snapshot:
        """Return the episode's state, as a value that no later step changes."""
        return Snapshot(
            task=self.task.name,
            task_version=self.task.version,
            machines=self._bench.values(),
            steps=self._steps,
            changes=self._changes,
            refused=self._refused,
            trials=self._trials,
            done=self._done,
        )

    def restore(self, state: Snapshot | Mapping[str, Any]) -> None:
        """Go to a state; costs what differs from the current one.

        Args:
            state: Value of `state`, from here or another environment of the task, or its document.

        Raises:
            SnapshotError: It is another task's, or not a state.
        """
        snapshot = state if isinstance(state, Snapshot) else Snapshot.from_document(state)
        if (snapshot.task, snapshot.task_version) != (self.task.name, self.task.version):
            raise SnapshotError(
                f"the state is of {snapshot.task} at version {snapshot.task_version}, and this is "
                f"{self.task.name} at {self.task.version}"
            )
        self._go_to(snapshot)

    def _go_to(self, snapshot: Snapshot) -> None:
        self._bench.return_to(snapshot.machines)
        self._steps, self._changes = snapshot.steps, snapshot.changes
        self._refused, self._trials = snapshot.refused, snapshot.trials
        self._done = snapshot.done
        self._reward = self._worth()

    def _worth(self) -> float:
        return weighed(self.weights, self._progress())

    def _progress(self) -> Progress:
        result = self._bench.result()
        return Progress(
            task=self.task,
            reference=self.reference,
            machine=None if result is None else result[1],
            changes=self._changes,
            refused=self._refused,
            trial=self.counted,
        )
