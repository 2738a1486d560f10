"""A fixed machine as an environment of Gymnasium, whose agent is the controller."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction, ResetNeeded
from numpy.typing import NDArray

from buildarena_benchmark import Task, broken_constraint, score
from buildarena_benchmark.environment import Progress, Trial, UnknownChoiceError
from buildarena_benchmark.environment.options import checked_simulator, reference_of, resolve_task
from buildarena_benchmark.environment.rewards import (
    DEFAULT_WEIGHTS,
    TERMINAL,
    checked_weights,
    weighed,
)
from buildarena_geometry import Machine
from buildarena_gymnasium.pictures import Picture, check_mode, picture_at, score_values
from buildarena_simulation import DEFAULT_ENGINE, Drive, SimulationError, pilot_of
from buildarena_simulation.constants import SAMPLE_RATE_HZ


@cache
def fixed_machines() -> Mapping[str, Any]:
    """Return the documents of the machines by task, in the order of the tasks."""
    text = files(__package__).joinpath("machines.json").read_text(encoding="utf-8")
    return dict(json.loads(text)["machines"])


def fixed_machine(task: str) -> Machine:
    """Return the machine for a task.

    Raises:
        UnknownChoiceError: The task has none.
    """
    documents = fixed_machines()
    if task not in documents:
        raise UnknownChoiceError("machine to be driven in task", task, documents)
    return Machine.from_document(documents[task])


Figures = NDArray[np.float64]

MAX_WORLD_SEED: Final = 2**31


class DriveEnv(gymnasium.Env[Figures, Figures]):
    """A task with a finished machine, whose controller is the agent.

    A step is a tick of 0.04 s. An observation contains a program's inputs, with the same noise and
    delay. An action contains a program's outputs: a value for each action of a block, from 0 to 1,
    or from -1 if the action has an opposite; others are clipped. The last tick ends the episode
    with the trial's score; a machine that diverges truncates it. ``info["time_s"]`` is the time;
    the reward comes with the last step.

    Args:
        task: The task, or the name of a built-in one; its scenario must offer senses.
        machine: Machine to drive; by default the built-in expert's machine for the task.
        simulator: Name of the engine.
        rewards: Weights of `success` and `indicator`; by default only success.
        reference: Indicator that is worth 1; by default the task's reference, if any.
        varied_worlds: Whether an episode without a seed gets a world drawn from the environment's
            random numbers; by default it gets the exact one.
        render_mode: ``rgb_array`` for pictures of the machine.

    Attributes:
        sense_names: The names of an observation's numbers: "marks.goal.relative.x".
        action_names: The names of an action's: "7.spinning_forward".
        trial: Trial of the episode that ended, with score and trajectory; None before.

    Raises:
        UnknownChoiceError: Task, simulator or a reward does not exist, or the task has no machine.
        ValueError: The task offers no senses, the machine breaks one of its constraints, a number
            is out of range, or the render mode is unknown.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": SAMPLE_RATE_HZ}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        task: Task | str = "hover-4",
        *,
        machine: Machine | None = None,
        simulator: str = DEFAULT_ENGINE,
        rewards: Mapping[str, float] | None = None,
        reference: float | None = None,
        varied_worlds: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = check_mode(render_mode, self.metadata["render_modes"])
        self.task, self.simulator = resolve_task(task), checked_simulator(simulator)
        self.weights = checked_weights(
            DEFAULT_WEIGHTS if rewards is None else rewards, sorted(TERMINAL)
        )
        self.reference = reference_of(
            self.task, reference, needed=self.weights.get("indicator", 0.0) != 0
        )
        if self.task.scenario.senses is None:
            offering = ", ".join(fixed_machines())
            raise ValueError(f"{self.task.name} offers no senses; valid tasks: {offering}")
        self.machine = machine or fixed_machine(self.task.name)
        broken = broken_constraint(self.task, self.machine)
        if broken is not None:
            raise ValueError(f"the machine is not allowed in {self.task.name}: {broken[1]}")
        pilot = pilot_of(self.machine, self.task.scenario)
        self.sense_names, self.action_names = pilot.sense_names, tuple(pilot.axes)
        self.observation_space = spaces.Box(
            -np.inf, np.inf, (len(self.sense_names),), dtype=np.float64
        )
        low = np.array(list(pilot.axes.values()))
        self.action_space = spaces.Box(low, np.ones_like(low), dtype=np.float64)
        self.trial: Trial | None = None
        self._varied_worlds = varied_worlds
        self._seed: int | None = None
        self._drive: Drive | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Figures, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seed of the world, like a trial's, and of later random worlds; None for the exact
                world, or a random one (`varied_worlds`).
            options: Must be empty.

        Raises:
            ValueError: An option was passed.
            SimulationError: The simulator failed; the call may be repeated.
        """
        super().reset(seed=seed)
        if options:
            raise ValueError(f"unknown option {next(iter(options))!r}: this environment has none")
        self._seed = seed
        if seed is None and self._varied_worlds:
            self._seed = int(self.np_random.integers(MAX_WORLD_SEED))
        self.close()
        self.trial = None
        self._drive = Drive(self.machine, self.task.scenario, self.simulator, seed=self._seed)
        seeds = {} if self._seed is None else {"world_seed": self._seed}
        return np.array(self._drive.senses), {"time_s": 0.0, **seeds}

    def step(self, action: Figures) -> tuple[Figures, float, bool, bool, dict[str, Any]]:
        """Simulate a tick.

        Args:
            action: (A,) in the order of `action_names`.

        Raises:
            ResetNeeded: The episode has ended, or none has begun.
            InvalidAction: The action has a wrong shape or type; the episode is unchanged.
            SimulationError: The simulator failed, and the episode is lost.
        """
        drive = self._drive
        if drive is None:
            raise ResetNeeded("no episode is active: call reset first")
        try:
            drive.step(self._answers(action))
            trajectory = drive.trajectory() if drive.is_over else None
        except SimulationError:
            self.close()
            raise
        info: dict[str, Any] = {"time_s": drive.time_s}
        reward = 0.0
        if trajectory is not None:
            self.close()
            result = score(self.task, self.machine, trajectory)
            self.trial = Trial(score=result, trajectory=trajectory)
            info["score"] = score_values(self.trial)
            reward = self._worth(self.trial)
        ended = drive.is_over
        return np.array(drive.senses), reward, ended and not drive.is_cut, drive.is_cut, info

    def render(self) -> Picture | None:
        """Draw the current machine, or the one at the end of the episode, (320, 480, 3) uint8.

        Raises:
            ResetNeeded: No episode has begun.
        """
        if self.render_mode is None:
            return None
        trajectory = None if self.trial is None else self.trial.trajectory
        if self._drive is not None:
            trajectory = self._drive.trajectory()
        if trajectory is None:
            raise ResetNeeded("no episode has begun: call reset first")
        return picture_at(self.machine, self.task.scenario.world(self._seed), trajectory)

    def close(self) -> None:
        """End the current episode without a score."""
        if self._drive is not None:
            self._drive.close()
            self._drive = None

    def _worth(self, trial: Trial) -> float:
        return weighed(
            self.weights,
            Progress(
                task=self.task,
                reference=self.reference,
                machine=self.machine,
                changes=0,
                refused=0,
                trial=trial,
            ),
        )

    def _answers(self, action: object) -> dict[str, float]:
        """Return the action's values by name."""
        names = self.action_names
        try:
            numbers = np.asarray(action)
        except ValueError:
            numbers = np.asarray(None)
        if numbers.shape != (len(names),) or numbers.dtype.kind not in "fiub":
            kind = type(action).__name__
            if isinstance(action, np.ndarray):
                kind = f"an array of {action.dtype} of shape {action.shape}"
            raise InvalidAction(
                f"an action is {len(names)} numbers, of {', '.join(names)}; not {kind}"
            )
        answers = dict(zip(names, numbers.astype(np.float64).tolist(), strict=True))
        for name, value in answers.items():
            if np.isnan(value):
                raise InvalidAction(f"the action for {name} is not a number")
        return answers
