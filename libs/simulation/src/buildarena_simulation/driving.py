"""A trial that somebody outside drives, tick after tick: as a program would, or with keys."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import isnan
from typing import TYPE_CHECKING

from buildarena_geometry.blocks import KeyPress
from buildarena_simulation.constants import DEFAULT_ENGINE, SAMPLE_RATE_HZ
from buildarena_simulation.control import ended_presses
from buildarena_simulation.controllers.pilot import Pilot
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.machine import bindings_of, part_ids, structure_of
from buildarena_simulation.planning import Keys
from buildarena_simulation.rollout import Rollout, require_engine
from buildarena_simulation.scenario import Scenario

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from buildarena_geometry import Machine
    from buildarena_simulation.trajectory import Break, Trajectory


def pilot_of(machine: Machine, scenario: Scenario, seed: int | None = None) -> Pilot:
    """What can be sensed and asked of a machine in a trial, before there is one.

    Args:
        machine: The machine.
        scenario: What it is put through.
        seed: As `simulate` takes it.

    Raises:
        MachineNotSimulable: It has no blocks or too many, or the scenario offers no senses.
    """
    structure, world = structure_of(machine), scenario.world(seed)
    return Pilot(structure, bindings_of(machine), part_ids(machine), world, seed=seed or 0)


class Drive:
    """A trial of a machine whose controller is outside.

    The same answers give the bytes of `simulate` with a program that answers so, but for the
    program's digest in the settings.

    Args:
        machine: The machine; its own controller and control sequence do not act.
        scenario: What it is put through.
        engine: Name of the engine.
        seed: As `simulate` takes it; also draws the noise of the senses.

    Attributes:
        pilot: The names of senses and actions.
        senses: What is sensed now, in the order of `pilot.sense_names`.
        time_s: When that is, seconds.

    Raises:
        MachineNotSimulable: As of `pilot_of`, or the machine cannot be placed.
        UnknownEngineError: No engine of this name is installed.
        SimulationError: The simulator failed.
    """

    def __init__(
        self,
        machine: Machine,
        scenario: Scenario,
        engine: str = DEFAULT_ENGINE,
        *,
        seed: int | None = None,
    ) -> None:
        require_engine(engine)
        self.pilot = pilot_of(machine, scenario, seed)
        self._rollout = Rollout(structure_of(machine), scenario, engine, seed=seed)
        self._trial = self._rollout.trial
        self._sense()

    @property
    def is_over(self) -> bool:
        """Whether the trial has ended."""
        return self._trial.is_over

    @property
    def is_cut(self) -> bool:
        """Whether the machine blew up, after which nothing can be known of it."""
        return self._trial.has_blown_up

    def step(self, answers: Mapping[str, float]) -> None:
        """Lets a tick pass with what blocks are asked for.

        After a machine blew up the rest of the trial passes at once, and senses stay what they were
        before.

        Args:
            answers: Numbers by names of actions, as a program answers them.

        Raises:
            ControllerFailed: There is no such action, or what it answers is no number; nothing
                has passed.
            SimulationError: The simulator failed; the trial cannot go on.
            ValueError: The trial is over.
        """
        if self.is_over:
            raise ValueError("the trial is over")
        for name, value in answers.items():
            if isnan(value):
                raise ControllerFailed(f"what it answers for {name[:60]} is no number")
        with self._rollout.running():
            self._pass(answers)
            while self.is_cut and not self.is_over:
                self._pass(answers)
        if not self.is_cut:
            self._sense()

    def trajectory(self) -> Trajectory:
        """What was recorded until now."""
        return self._rollout.trajectory(self.pilot)

    def close(self) -> None:
        """Ends the engine's world; the trial cannot go on."""
        self._rollout.close()

    def _pass(self, answers: Mapping[str, float]) -> None:
        self._trial.ask(self.pilot.levels(self.senses, answers))
        self._trial.pass_tick()

    def _sense(self) -> None:
        seen = self._trial.seen()
        self.senses, self.time_s = self.pilot.senses(seen), seen.time_s


class KeyDrive:
    """A trial of a machine whose keys somebody holds, in the exact world.

    With `presses` as the machine's control sequence, `simulate` gives the same bytes.

    Args:
        machine: The machine; its own controller and control sequence do not act.
        scenario: What it is put through.
        engine: Name of the engine.

    Attributes:
        tick: How many ticks of 0.04 s have passed.

    Raises:
        MachineNotSimulable: It has no blocks or too many, or cannot be placed.
        UnknownEngineError: No engine of this name is installed.
        SimulationError: The simulator failed.
    """

    def __init__(self, machine: Machine, scenario: Scenario, engine: str = DEFAULT_ENGINE) -> None:
        require_engine(engine)
        self._bindings, self._control = bindings_of(machine), scenario.control
        self._rollout = Rollout(structure_of(machine), scenario, engine)
        self._trial = self._rollout.trial
        self._since: dict[str, int] = {}
        self._presses: list[KeyPress] = []
        self.tick = 0

    @property
    def is_over(self) -> bool:
        """Whether the trial has ended."""
        return self._trial.is_over

    @property
    def has_blown_up(self) -> bool:
        """Whether nothing more can be known of the machine."""
        return self._trial.has_blown_up

    @property
    def breaks(self) -> list[Break]:
        """The joints that broke, in the order of their breaking."""
        return self._trial.breaking.breaks

    @property
    def poses(self) -> NDArray[np.float32]:
        """(N, 7) where the blocks are, see `Recorder.poses_now`."""
        return self._trial.recorder.poses_now

    def step(self, held: Collection[str]) -> None:
        """Lets a tick pass.

        Args:
            held: The keys that are held meanwhile; those that nothing is bound to do nothing.

        Raises:
            SimulationError: The simulator failed; the trial cannot go on.
            ValueError: The trial is over.
        """
        if self.is_over:
            raise ValueError("the trial is over")
        for key in [key for key in self._since if key not in held]:
            self._presses.append(self._press(key, self._since.pop(key)))
        for key in held:
            self._since.setdefault(key, self.tick)
        self.tick += 1
        with self._rollout.running():
            self._trial.press(self._keys([self._press(key, self.tick - 1) for key in held]))
            self._trial.pass_tick()

    def presses(self) -> list[KeyPress]:
        """The keys that were held until now, by time and name."""
        lasting = (self._press(key, since) for key, since in self._since.items())
        return sorted([*self._presses, *lasting], key=lambda press: (press.time_s, press.key))

    def trajectory(self) -> Trajectory:
        """What was recorded until now."""
        return self._rollout.trajectory(self._keys(self.presses()))

    def close(self) -> None:
        """Ends the engine's world; the trial cannot go on."""
        self._rollout.close()

    def _press(self, key: str, since: int) -> KeyPress:
        """A key that was held from a tick until now."""
        first_s, last_s = (round(tick / SAMPLE_RATE_HZ, 6) for tick in (since, self.tick))
        return KeyPress(time_s=first_s, key=key, hold_for_s=round(last_s - first_s, 6))

    def _keys(self, presses: list[KeyPress]) -> Keys:
        return Keys(
            bindings=self._bindings,
            presses=ended_presses(presses, self._control),
            count=self._control.mode == "agent",
        )
