"""A trial: the simulation of a structure in a scenario by an engine."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from functools import cache
from importlib import import_module
from typing import Any, Final
from weakref import finalize

from buildarena_simulation.clearance import require_clear_start
from buildarena_simulation.constants import DEFAULT_ENGINE
from buildarena_simulation.control import (
    PRESSES,
    SEED,
    Bindings,
    KeyHold,
    ended_presses,
    varied_presses,
    written_presses,
)
from buildarena_simulation.controllers.pilot import Pilot, ProgramPilot
from buildarena_simulation.engines.base import World
from buildarena_simulation.engines.registry import ENGINES, create_engine, engine_version
from buildarena_simulation.errors import (
    BuildarenaSimulationError,
    SimulationError,
    UnknownEngineError,
)
from buildarena_simulation.gusts import Blows
from buildarena_simulation.placement import Start, start_digest, start_of
from buildarena_simulation.planning import Keys
from buildarena_simulation.processor import warn_if_late
from buildarena_simulation.scenario import Control, Scenario
from buildarena_simulation.structure.force_field import Surroundings, field_of
from buildarena_simulation.structure.model import Structure
from buildarena_simulation.trajectory import Trajectory
from buildarena_simulation.trial import Decision, Trial

SIMULATION_VERSION: Final = "10"
"""Version of the shared model: rises with every change that can move a trajectory."""


def require_engine(name: str) -> str:
    """Return the name of an engine, if it is installed.

    Raises:
        UnknownEngineError: It is not; the message lists the installed ones and the command for the
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


def simulate_structure(
    structure: Structure,
    scenario: Scenario,
    engine: str,
    *,
    bindings: Bindings = (),
    controls: Sequence[KeyHold] = (),
    pilot: ProgramPilot | None = None,
    start: Start | None = None,
    seed: int | None = None,
    substeps: int = 1,
    until: Decision | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a structure in a scenario; see `simulate`.

    Args:
        engine: Name of the engine.
        bindings: (N,) keys of each block's actions; may be empty if nothing is pressed.
        pilot: Program that replaces the control sequence.
        start: See `simulate`.
        seed: See `simulate`.
        substeps: See `simulate`.
        until: See `simulate`.
        on_progress: Callback for the completed share of the trial, 0 to 1.
    """
    control = scenario.control  # no seed draws it
    if seed is not None:
        controls, control = varied_presses(controls, control, seed)
    commander = pilot or Keys(
        bindings=bindings,
        presses=ended_presses(controls, control),
        count=control.mode == "agent",
    )
    rollout = Rollout(
        structure, scenario, engine, control=control, start=start, seed=seed, substeps=substeps
    )
    with closing(rollout):
        with rollout.running():
            rollout.trial.run(commander, until, on_progress)
        return rollout.trajectory(commander)


class Rollout:
    """A trial that was set up and not yet run.

    Args:
        engine: Name of the engine.
        control: Control that replaces the scenario's.
        start: See `simulate`.
        seed: See `simulate`.
        substeps: See `simulate`.

    Attributes:
        trial: Trial, to be run within `running`.
    """

    def __init__(
        self,
        structure: Structure,
        scenario: Scenario,
        engine: str,
        *,
        control: Control | None = None,
        start: Start | None = None,
        seed: int | None = None,
        substeps: int = 1,
    ) -> None:
        self._engine_name, self._seed, self._unvaried = engine, seed, scenario
        self._placed = start is not None
        self._scenario = scenario = scenario.world(seed)
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
            field=field_of(
                structure,
                drive_strength=scenario.drive_strength,
                around=surroundings_of(scenario),
            ),
            planet=None if scenario.planet is None else scenario.planet.radius,
        )
        if control is not None:
            scenario = scenario.model_copy(update={"control": control})
        self._start = start
        warn_if_late()
        self._adapter = create_engine(engine, world)
        self._ending = finalize(self, self._adapter.close)
        try:
            with self.running():
                blows = scenario.gusts or scenario.pushes
                wind = Blows(scenario, seed or 0) if blows else None
                self.trial = Trial(world, scenario, self._adapter, start, wind)
        except BaseException:
            self.close()
            raise

    @contextmanager
    def running(self) -> Iterator[None]:
        """Prepare the process for the engine's steps in this context.

        Raises:
            SimulationError: The engine failed.
        """
        with self._failing(), single_threaded():
            yield

    def trajectory(self, commander: Keys | Pilot) -> Trajectory:
        """Return the trajectory recorded until now.

        Args:
            commander: Controller of the trial.
        """
        seed = self._seed
        scenario = hashlib.sha256(self._unvaried.model_dump_json().encode()).hexdigest()[:16]
        with self._failing():
            holds = commander.holds()
            return self.trial.recorder.finished(
                breaking=self.trial.breaking,
                piloting=commander.piloting(),
                engine=self._engine_name,
                engine_version=engine_version(self._engine_name),
                simulation_version=SIMULATION_VERSION,
                settings={
                    **self._adapter.settings,
                    "gravity": self._scenario.gravity,
                    **_unusual(self._scenario),
                    "effective_key_presses": len(holds),
                    PRESSES: written_presses(holds),
                    **({} if seed is None else {SEED: seed}),
                    **({"start": start_digest(self._start)} if self._placed else {}),
                    **commander.settings(),
                    "scenario": scenario,
                },
            )

    def close(self) -> None:
        """Release the engine's world; safe to repeat, and done by garbage collection too."""
        self._ending()

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Report unexpected errors inside as the engine's failure."""
        try:
            yield
        except BuildarenaSimulationError:
            raise
        except Exception as error:
            raise SimulationError(f"{self._engine_name} failed: {error}") from error


def world_of(scenario: Scenario, trajectory: Trajectory) -> Scenario:
    """Return the scenario of a trial, with the parameters that its seed drew."""
    seed = trajectory.settings.get(SEED)
    return scenario.world(None if seed is None else int(seed))


def surroundings_of(scenario: Scenario) -> Surroundings:
    """Return the gravity and the air of a scenario."""
    planet = scenario.planet
    if planet is None:
        return Surroundings(gravity=scenario.gravity)
    return Surroundings(
        gravity=scenario.gravity,
        radius=planet.radius,
        air=planet.air,
        air_height=planet.air_height,
    )


def _unusual(scenario: Scenario) -> dict[str, float]:
    """Return the settings that differ from the usual ones."""
    strength = scenario.drive_strength
    return {} if strength == 1 else {"drive_strength": strength}


def _check_start(start: Start, scenario: Scenario, seed: int | None) -> None:
    if seed is not None:
        raise ValueError("a start is exact, and a seed varies it: give one of them")
    if (start.cargo is None) != (scenario.cargo is None):
        lacking = "start" if start.cargo is None else "scenario"
        raise ValueError(f"the {lacking} has no cargo, and the other one has")


def single_threaded() -> AbstractContextManager[object]:
    """Limit NumPy's and SciPy's BLAS to one thread of this process in this context.

    Sums over several threads depend on how many cores a machine has.
    """
    limits: AbstractContextManager[object] = _threads().limit(limits=1, user_api="blas")
    return limits


@cache
def _threads() -> Any:
    """Return the process's thread pools; finding them takes longer than a tick of a trial."""
    import_module("scipy.sparse.linalg")  # loads its own BLAS, which is limited as well
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
