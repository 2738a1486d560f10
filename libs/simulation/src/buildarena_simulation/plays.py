"""A machine put through a scenario: once, or again and again."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from buildarena_simulation.constants import DEFAULT_ENGINE
from buildarena_simulation.control import KeyHold
from buildarena_simulation.controllers.pilot import ProgramPilot
from buildarena_simulation.errors import MachineNotSimulable
from buildarena_simulation.machine import bindings_of, part_ids, structure_of
from buildarena_simulation.placement import Start
from buildarena_simulation.rollout import require_engine, simulate_structure
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.trajectory import Trajectory
from buildarena_simulation.trial import Decision

if TYPE_CHECKING:
    from buildarena_geometry import Machine


def simulate(
    machine: "Machine",
    scenario: Scenario,
    engine: str = DEFAULT_ENGINE,
    *,
    controls: Sequence[KeyHold] | None = None,
    start: Start | None = None,
    seed: int | None = None,
    substeps: int = 1,
    until: Decision | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a machine in a scenario. The same input gives the same bytes.

    Args:
        engine: Name of the engine; see `ENGINES`.
        controls: Control sequence to use instead of the machine's, or of its controller.
        start: Start of machine and cargo, in place of the scenario's.
        seed: Seed of the scenario's random parameters and of the perturbed start, see `start_of`;
            None for the exact start.
        substeps: Number of substeps per default step of the engine, to distinguish a result of the
            model from one of the step size.
        until: Condition that decides the trial, which goes on for one second after it; see
            `Trial.run`. Defaults to the scenario's duration.
        on_progress: Called now and then with the share of the trial that is done, 0 to 1.

    Returns:
        The trajectory.

    Raises:
        MachineNotSimulable: The machine is empty, unplaceable or too large, or its controller
            failed; a failed trial.
        UnknownEngineError: No engine of this name is installed.
        ValueError: A start and a seed are given, or only one of start and scenario has a cargo.
        SimulationError: The simulator failed; never scored.
    """
    play = Play(controls=controls, start=start, seed=seed, until=until)
    return _Model(machine).played(
        scenario, engine, play, substeps=substeps, on_progress=on_progress
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """A trial of several of a machine; see `simulate`.

    Attributes:
        controls: Control sequence to use instead of the machine's, or of its controller.
        start: Start of machine and cargo, in place of the scenario's.
        seed: Seed of random parameters and of the perturbed start; None for the exact start.
        until: Condition that decides the trial.
    """

    controls: Sequence[KeyHold] | None = None
    start: Start | None = None
    seed: int | None = None
    until: Decision | None = None


def simulate_many(
    machine: "Machine",
    scenario: Scenario,
    engine: str = DEFAULT_ENGINE,
    *,
    plays: Iterable[Play],
) -> Iterator[Trajectory | MachineNotSimulable]:
    """Simulate a machine in a scenario repeatedly, with different seeds, keys or starts.

    The machine's model is computed once. Each trajectory has the bytes of `simulate`.

    Args:
        machine: Machine, which must not change meanwhile.
        engine: Name of the engine; see `ENGINES`.
        plays: Trials; each is simulated when its turn comes.

    Yields:
        The result of each trial in order: its trajectory, or the machine's failure.

    Raises:
        UnknownEngineError: No engine of this name is installed.
        ValueError: See `simulate`.
        SimulationError: The simulator failed; never scored.
    """
    model = _Model(machine)
    for play in plays:
        outcome: Trajectory | MachineNotSimulable
        try:
            outcome = model.played(scenario, engine, play)
        except MachineNotSimulable as refusal:
            outcome = refusal
        yield outcome


class _Model:
    """Model of a machine, shared by all of its trials."""

    def __init__(self, machine: "Machine") -> None:
        self._machine = machine

    @cached_property
    def _structure(self) -> Structure:
        return structure_of(self._machine)

    def played(
        self,
        scenario: Scenario,
        engine: str,
        play: Play,
        *,
        substeps: int = 1,
        on_progress: Callable[[float], None] | None = None,
    ) -> Trajectory:
        """Simulate one trial; see `simulate`."""
        require_engine(engine)
        machine, structure, seed = self._machine, self._structure, play.seed
        bindings, controls, pilot = bindings_of(machine), play.controls, None
        if machine.controller and controls is None:
            pilot = ProgramPilot(
                machine.controller,
                structure,
                bindings,
                part_ids(machine),
                scenario.world(seed),
                seed=seed or 0,
            )
        return simulate_structure(
            structure,
            scenario,
            engine,
            bindings=bindings,
            controls=machine.control_sequence if controls is None else controls,
            pilot=pilot,
            start=play.start,
            seed=seed,
            substeps=substeps,
            until=play.until,
            on_progress=on_progress,
        )
