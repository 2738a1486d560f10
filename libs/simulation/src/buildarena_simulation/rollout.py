"""One trial: a machine put through a scenario by an engine."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.breaking import BreakingModel
from buildarena_simulation.clearance import require_clear_start
from buildarena_simulation.constants import DEFAULT_ENGINE, SAMPLE_RATE_HZ
from buildarena_simulation.control import (
    PRESSES,
    Bindings,
    KeyHold,
    effective_presses,
    ended_presses,
    plan_schedule,
    recoil,
    varied_presses,
    written_presses,
)
from buildarena_simulation.engines.base import Engine, World
from buildarena_simulation.engines.registry import ENGINES, create_engine, engine_version
from buildarena_simulation.errors import (
    BuildarenaSimulationError,
    SimulationError,
    UnknownEngineError,
)
from buildarena_simulation.force_control import ForceSchedule, plan_forces
from buildarena_simulation.holding import Holding
from buildarena_simulation.machine import bindings_of, structure_of
from buildarena_simulation.placement import Start, start_digest, start_of
from buildarena_simulation.processor import warn_if_late
from buildarena_simulation.recording import Recorder
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.clusters import find_clusters
from buildarena_simulation.structure.force_field import field_of
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.structure.motion import Motion, at_rest
from buildarena_simulation.threads import single_threaded
from buildarena_simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from buildarena_geometry import Machine

SIMULATION_VERSION: Final = "6"
"""Version of the shared model: rises with every change that can move a trajectory."""

_PROGRESS_EVERY = 10
_FINER = 2
"""Into how many a step is divided where an interval is repeated."""

Decision = Callable[[np.ndarray | None], bool]
"""Whether a trial is decided, from the cargo's position (3,) as it is recorded; None without."""


def require_engine(name: str) -> str:
    """The name of an engine, if that is installed.

    Raises:
        UnknownEngineError: It is not; the message names those that are, and how to install the
            default.
    """
    if name in ENGINES:
        return name
    installed = ", ".join(ENGINES)
    if name == DEFAULT_ENGINE:
        raise UnknownEngineError(
            f"the default engine {name!r} is not installed: `pip install {name}`, or name another; "
            f"there are {installed}"
        )
    raise UnknownEngineError(f"no engine {name!r}; there are {installed}")


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
    """Puts a machine through a scenario. The same input gives the same bytes.

    Args:
        machine: The machine.
        scenario: What it is put through.
        engine: Name of the engine; see `ENGINES`.
        controls: A control sequence to use in place of the machine's own.
        start: Where machine and cargo start, in place of where the scenario puts them.
        seed: Varies the start as a fair repetition would, see `start_of`; None for the exact one.
        substeps: Into how many each of the engine's usual steps is divided, to distinguish a
            result of the model from one of the step size.
        until: Ends the trial after the first sample for which it is true; by default it lasts for
            the scenario's duration.
        on_progress: Called now and then with the share of the trial that is done, 0 to 1.

    Returns:
        The trajectory.

    Raises:
        MachineNotSimulable: The machine is empty, unplaceable or too large; a failed trial.
        UnknownEngineError: No engine of this name is installed.
        ValueError: A start and a seed are given, or only one of start and scenario has a cargo.
        SimulationError: The simulator failed; never scored.
    """
    require_engine(engine)
    structure = structure_of(machine)
    return simulate_structure(
        structure,
        scenario,
        engine,
        bindings=bindings_of(machine),
        controls=machine.control_sequence if controls is None else controls,
        start=start,
        seed=seed,
        substeps=substeps,
        until=until,
        on_progress=on_progress,
    )


def simulate_structure(
    structure: Structure,
    scenario: Scenario,
    engine: str,
    *,
    bindings: Bindings = (),
    controls: Sequence[KeyHold] = (),
    start: Start | None = None,
    seed: int | None = None,
    substeps: int = 1,
    until: Decision | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Puts a structure through a scenario; see `simulate`.

    Args:
        structure: The machine as arrays.
        scenario: What it is put through.
        engine: Name of the engine.
        bindings: (N,) the keys of each block's actions; may be empty if nothing is pressed.
        controls: The control sequence.
        start: See `simulate`.
        seed: See `simulate`.
        substeps: See `simulate`.
        until: See `simulate`.
        on_progress: Called now and then with the share of the trial that is done.
    """
    unvaried, placed = scenario, start is not None
    if start is None:
        start = start_of(structure, scenario, seed)
    else:
        _check_start(start, scenario, seed)
    require_clear_start(structure, scenario, start)
    world = World(
        structure=structure,
        ground=True,
        terrain=scenario.terrain,
        cargo=start.cargo,
        gravity=scenario.gravity,
        drive_strength=scenario.drive_strength,
        substeps=substeps,
        field=field_of(structure, drive_strength=scenario.drive_strength),
    )
    if seed is not None:
        controls, control = varied_presses(controls, scenario.control, seed)
        scenario = scenario.model_copy(update={"control": control})
    controls = ended_presses(controls, scenario.control)
    warn_if_late()
    adapter = create_engine(engine, world)
    try:
        with single_threaded():
            trial = _Trial(world, scenario, adapter, start)
            trial.run(bindings or [{}] * len(structure), controls, until, on_progress)
        return trial.recorder.finished(
            breaking=trial.breaking,
            engine=engine,
            engine_version=engine_version(engine),
            simulation_version=SIMULATION_VERSION,
            settings={
                **adapter.settings,
                "gravity": scenario.gravity,
                **_unusual(scenario),
                "effective_key_presses": effective_presses(bindings, controls),
                PRESSES: written_presses(bindings, controls),
                **({} if seed is None else {"seed": seed}),
                **({"start": start_digest(start)} if placed else {}),
                "scenario": hashlib.sha256(unvaried.model_dump_json().encode()).hexdigest()[:16],
            },
        )
    except BuildarenaSimulationError:
        raise
    except Exception as error:
        raise SimulationError(f"{engine} failed: {error}") from error
    finally:
        adapter.close()


def _unusual(scenario: Scenario) -> dict[str, float]:
    """What is written down only where it is not as usual."""
    strength = scenario.drive_strength
    return {} if strength == 1 else {"drive_strength": strength}


def _check_start(start: Start, scenario: Scenario, seed: int | None) -> None:
    if seed is not None:
        raise ValueError("a start is exact, and a seed varies it: give one of them")
    if (start.cargo is None) != (scenario.cargo is None):
        lacking = "start" if start.cargo is None else "scenario"
        raise ValueError(f"the {lacking} has no cargo, and the other one has")


class _Trial:
    """The state of one running trial."""

    def __init__(
        self,
        world: World,
        scenario: Scenario,
        engine: Engine,
        start: Start,
    ) -> None:
        structure = world.structure
        self._structure, self._scenario, self._engine = structure, scenario, engine
        self._field = world.field
        self._let_go = np.zeros(0 if world.field is None else len(world.field.table.seats), bool)
        holds = np.ones(len(structure.members), dtype=bool)
        clusters = find_clusters(structure, holds)
        motion = at_rest(clusters, start.position, start.rotation)
        if start.velocity.any():
            motion = replace(motion, velocity=motion.velocity + start.velocity)
        engine.enter(clusters, motion)
        self._interval_s = engine.time_step_s * engine.steps_per_evaluation
        self.breaking = BreakingModel(world, clusters, motion, interval_s=self._interval_s)
        if any(part.module.grip for part in structure.parts):
            self.breaking.holding = Holding(world)
        self.recorder = Recorder(structure, scenario)
        self._blown_up = False

    def run(
        self,
        bindings: Bindings,
        controls: Sequence[KeyHold],
        until: Decision | None,
        on_progress: Callable[[float], None] | None,
    ) -> None:
        engine, scenario = self._engine, self._scenario
        per_sample = round(1 / (SAMPLE_RATE_HZ * engine.time_step_s))
        chunks = range(0, per_sample, engine.steps_per_evaluation)
        samples = scenario.sample_count - 1
        schedule = plan_schedule(
            self._structure,
            bindings,
            controls,
            control=scenario.control,
            step_count=samples * per_sample,
            time_step_s=engine.time_step_s,
        )
        forces = None
        if self._field is not None:
            forces = plan_forces(
                self._structure,
                self._field.table,
                bindings,
                controls,
                control=scenario.control,
                times=engine.time_step_s * np.arange(samples * per_sample, dtype=np.float64),
            )
        self._sample(0.0)
        for sample in range(samples):
            for offset in chunks:
                first = sample * per_sample + offset
                rows = slice(first, first + engine.steps_per_evaluation)
                if forces is not None:
                    self._command(forces, first)
                self._advance(schedule.targets[rows], schedule.firing[first], first)
            self._sample((sample + 1) / SAMPLE_RATE_HZ)
            if until is not None and until(self.recorder.cargo_now):
                return
            if on_progress and (sample % _PROGRESS_EVERY == 0 or sample + 1 == samples):
                on_progress((sample + 1) / samples)

    def _command(self, schedule: ForceSchedule, step: int) -> None:
        """Tells the blocks that exert forces by themselves what the keys ask for."""
        field = self._field
        if field is None:
            return
        table = field.table
        asked = schedule.let_go[step] & ~self._let_go
        kicks = np.zeros(len(asked))
        if asked.any() and not self._blown_up:
            self._let_go |= asked
            held = self.breaking.let_go(
                self._engine, table.seats[asked], time_s=step * self._engine.time_step_s
            )
            # The push lasts one interval, so that the loads that it makes are seen.
            kicks[asked] = held * table.impulse[asked] / self._interval_s
        field.commands = schedule.at(step, kicks)
        holding, breaking = self.breaking.holding, self.breaking
        if holding is not None and not self._blown_up:
            cargo = self._engine.cargo() if self._scenario.cargo else None
            if holding.update(
                breaking.clusters,
                breaking.motion,
                cargo,
                grab=schedule.grab[step],
                release=schedule.release[step],
                time_s=step * self._engine.time_step_s,
            ):
                self._hold(holding)

    def _hold(self, holding: Holding) -> None:
        self._engine.hold(holding.holds)
        self._engine.enter(self.breaking.clusters, self.breaking.motion)

    def _advance(self, targets: np.ndarray, firing: np.ndarray, step: int) -> None:
        if self._blown_up:
            return
        engine, cargo = self._engine, self._scenario.cargo
        time_s = step * engine.time_step_s
        mass = cargo.mass_at(time_s) if cargo else None
        if mass is not None:
            engine.set_cargo_mass(mass)
        thrusts = recoil(self._structure, firing, self.recorder.heated_now)
        before, place = self.breaking.motion, engine.cargo() if cargo else None
        engine.advance(targets, thrusts)
        motion = engine.motion()
        if not (np.isfinite(motion.position).all() and np.isfinite(motion.rotation).all()):
            # Nothing more can be known; the samples say so and the scorer flags them.
            self._blown_up = True
            self.breaking.motion = motion
            return
        holding = self.breaking.holding
        slipped = holding is not None and holding.follow(
            engine, time_s=time_s + self._interval_s, interval_s=self._interval_s
        )

        def repeat_finer() -> Motion:
            finer = np.repeat(targets, _FINER, axis=0)
            engine.enter(self.breaking.clusters, before, cargo=place, finer=_FINER)
            engine.advance(finer, thrusts)
            if holding is not None:
                holding.read(engine)
            return engine.motion()

        self.breaking.follow(
            engine,
            motion,
            thrusts,
            time_s=time_s + self._interval_s,
            cargo_mass=mass,
            repeat_finer=None if slipped else repeat_finer,
        )
        if slipped and holding is not None:
            self._hold(holding)

    def _sample(self, time_s: float) -> None:
        cargo = self._scenario.cargo
        self.recorder.record(
            time_s,
            self.breaking.motion,
            self.breaking.clusters,
            self._engine.cargo() if cargo else None,
            cargo.mass_at(time_s) if cargo else None,
            bearing=self.breaking.bearing.now,
            loads=self.breaking.taken_loads(),
        )
