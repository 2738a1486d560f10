"""A trial that somebody outside drives, tick after tick, as a program would."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from typing import TYPE_CHECKING

from buildarena_simulation.constants import DEFAULT_ENGINE
from buildarena_simulation.controllers.pilot import Pilot
from buildarena_simulation.errors import ControllerFailed
from buildarena_simulation.machine import bindings_of, part_ids, structure_of
from buildarena_simulation.rollout import Rollout, require_engine
from buildarena_simulation.scenario import Scenario

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation.trajectory import Trajectory


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
