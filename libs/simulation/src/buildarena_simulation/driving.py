"""A trial with an external driver, who acts tick after tick as a program would."""

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
    """Return the senses and actions of a machine for a trial, before it starts.

    Args:
        seed: Seed as in `simulate`.

    Raises:
        MachineNotSimulable: It has no blocks or too many, or the scenario offers no senses.
    """
    structure, world = structure_of(machine), scenario.world(seed)
    return Pilot(structure, bindings_of(machine), part_ids(machine), world, seed=seed or 0)


class Drive:
    """A trial of a machine with an external controller.

    The same answers give the bytes of `simulate` with a program of these answers, except for the
    program's digest in the settings.

    Args:
        machine: Machine, whose own controller and control sequence are ignored.
        engine: Name of the engine.
        seed: Seed as in `simulate`; also that of the noise of the senses.

    Attributes:
        pilot: Names of senses and actions.
        senses: Present senses, in the order of `pilot.sense_names`.
        time_s: Time of the senses, seconds.

    Raises:
        MachineNotSimulable: See `pilot_of`; or the machine cannot be placed.
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
        """True once the trial has ended."""
        return self._trial.is_over

    @property
    def is_cut(self) -> bool:
        """True once the machine blew up, after which its state is unknown."""
        return self._trial.has_blown_up

    def step(self, answers: Mapping[str, float]) -> None:
        """Advance the trial by a tick with these commands.

        After a machine blew up the rest of the trial passes at once, and senses stay unchanged.

        Args:
            answers: Numbers by names of actions, as a program answers them.

        Raises:
            ControllerFailed: An action is unknown, or an answer is not a number; the trial has not
                advanced.
            SimulationError: The simulator failed; the trial cannot continue.
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
        """Return the trajectory recorded until now."""
        return self._rollout.trajectory(self.pilot)

    def close(self) -> None:
        """Release the engine's world; the trial cannot continue."""
        self._rollout.close()

    def _pass(self, answers: Mapping[str, float]) -> None:
        self._trial.ask(self.pilot.levels(self.senses, answers))
        self._trial.pass_tick()

    def _sense(self) -> None:
        snapshot = self._trial.snapshot()
        self.senses, self.time_s = self.pilot.senses(snapshot), snapshot.time_s
