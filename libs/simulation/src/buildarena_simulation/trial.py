"""A running trial: commands, steps, loads, samples."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from buildarena_simulation.acting import Interval
from buildarena_simulation.breaking import BreakingModel
from buildarena_simulation.constants import AFTER_S, SAMPLE_RATE_HZ
from buildarena_simulation.control import Levels, Steady, recoil, released_at
from buildarena_simulation.controllers.pilot import ProgramPilot
from buildarena_simulation.controllers.senses import Snapshot
from buildarena_simulation.engines.base import Engine, World
from buildarena_simulation.force_control import ForceSchedule
from buildarena_simulation.gusts import Blows
from buildarena_simulation.holding import Holding
from buildarena_simulation.placement import Start, motion_at
from buildarena_simulation.planning import Keys, Planner
from buildarena_simulation.recording import Moment, Recorder
from buildarena_simulation.scenario import Scenario
from buildarena_simulation.structure.clusters import find_clusters
from buildarena_simulation.structure.force_field import Commands
from buildarena_simulation.structure.motion import Motion
from buildarena_simulation.structure.tanks import Tanks, tanks_of

_PROGRESS_EVERY = 10
_FINER = 2
"""Number of substeps in a repeated interval."""

SAMPLES_AFTER: Final = round(AFTER_S * SAMPLE_RATE_HZ)

Decision = Callable[[Moment], bool]
"""Condition that decides a trial; called for each sample but the first, in order, until it does."""


class Trial:
    """State of one running trial.

    Args:
        engine: The engine, with that world.
        wind: Acceleration of everything; None without.

    Attributes:
        has_blown_up: True once the engine's numbers are invalid; nothing moves from there on.
        breaking: Loads of the joints, and breaks.
    """

    def __init__(
        self,
        world: World,
        scenario: Scenario,
        engine: Engine,
        start: Start,
        wind: Blows | None = None,
    ) -> None:
        structure = world.structure
        self._structure, self._scenario, self._engine = structure, scenario, engine
        self._field, self._wind = world.field, wind
        self._tanks = tanks_of(structure, None if world.field is None else world.field.table)
        self._let_go = np.zeros(
            0 if world.field is None else len(world.field.table.decoupled), bool
        )
        holds = np.ones(len(structure.members), dtype=bool)
        clusters = find_clusters(structure, holds)
        motion = motion_at(start, clusters)
        engine.enter(clusters, motion)
        self._interval_s = engine.time_step_s * engine.steps_per_evaluation
        grips = any(part.module.grip for part in structure.parts)
        self._holding = Holding(world) if grips else None
        self.breaking = BreakingModel(world, clusters, motion, self._holding)
        self.recorder = Recorder(structure, scenario)
        self.has_blown_up = self._is_decided = False
        self._per_sample = round(1 / (SAMPLE_RATE_HZ * engine.time_step_s))
        self._planner = Planner(structure, self._field, scenario, engine.time_step_s)
        self._tick, self._ticks = 0, scenario.sample_count - 1
        self._sample(0.0)

    @property
    def is_over(self) -> bool:
        """True once the last tick has passed."""
        return self._tick >= self._ticks

    def run(
        self,
        commander: Keys | ProgramPilot,
        until: Decision | None,
        on_progress: Callable[[float], None] | None,
    ) -> None:
        """Run it to its end, or until it is decided and `AFTER_S` longer.

        Args:
            commander: Controller of the trial.
            until: Condition that decides the trial. From then on loads are not evaluated, and
                nothing breaks.
            on_progress: Callback for the completed share of the trial, 0 to 1.

        Raises:
            ControllerFailed: The controller failed.
        """
        steps = self._ticks * self._per_sample
        if isinstance(commander, Keys):
            levels = commander.levels(self._planner.times(0, steps))
            self._planner.plan(levels, 0, steps)
        released_s = math.inf
        if isinstance(commander, Keys) and commander.count:
            released_s = released_at(commander.holds())
        while not self.is_over:
            if isinstance(commander, ProgramPilot):
                self.ask(commander.answer(self.snapshot()))
            self.pass_tick()
            if until is not None and until(self.recorder.moment(released_s)):
                self._ticks = min(self._tick + SAMPLES_AFTER, self._ticks)
                self._is_decided, until = True, None
            if on_progress and (self._tick % _PROGRESS_EVERY == 1 or self.is_over):
                on_progress(self._tick / self._ticks)

    def ask(self, levels: Mapping[tuple[int, str], float]) -> None:
        """Set the commands of the next tick; see `Channels.levels`."""
        self._plan(Steady(levels, self._per_sample))

    def press(self, keys: Keys) -> None:
        """Set the keys that are held in the next tick."""
        first = self._tick * self._per_sample
        self._plan(keys.levels(self._planner.times(first, self._per_sample)))

    def _plan(self, levels: Levels) -> None:
        self._planner.plan(levels, self._tick * self._per_sample, self._per_sample)

    def pass_tick(self) -> None:
        """Advance by a tick with the set commands."""
        engine, planner = self._engine, self._planner
        for offset in range(0, self._per_sample, engine.steps_per_evaluation):
            step = self._tick * self._per_sample + offset
            row = step - planner.first
            if planner.forces is not None:
                self._command(planner.forces, row, step)
            targets = planner.drives.targets[row : row + engine.steps_per_evaluation]
            self._advance(targets, planner.drives.firing[row], step)
        self._tick += 1
        self._sample(self._tick / SAMPLE_RATE_HZ)

    def snapshot(self) -> Snapshot:
        """Return the state that can be sensed now."""
        breaking = self.breaking
        return Snapshot(
            time_s=self._tick / SAMPLE_RATE_HZ,
            clusters=breaking.clusters,
            motion=breaking.motion,
            cargo=self._engine.cargo() if self._scenario.cargo else None,
            on_blocks=breaking.on_blocks,
            fuel_s=self._planner.tank.left_s,
        )

    def _command(self, schedule: ForceSchedule, row: int, step: int) -> None:
        """Set the commands to blocks that exert forces by themselves."""
        field = self._field
        if field is None:
            return
        table = field.table
        asked = schedule.let_go[row] & ~self._let_go
        kicks = np.zeros(len(asked))
        if asked.any() and not self.has_blown_up:
            self._let_go |= asked
            held = self.breaking.let_go(
                self._engine, table.decoupled[asked], time_s=step * self._engine.time_step_s
            )
            # The push lasts one interval, so that the loads that it makes are seen.
            kicks[asked] = held * table.impulse[asked] / self._interval_s
        field.commands = schedule.at(row, kicks)
        if self._tanks is not None:
            field.commands = self._burn(self._tanks, field.commands)
        holding, breaking = self._holding, self.breaking
        if holding is not None and not self.has_blown_up:
            cargo = self._engine.cargo() if self._scenario.cargo else None
            if holding.update(
                breaking.clusters,
                breaking.motion,
                cargo,
                grab=schedule.grab[row],
                release=schedule.release[row],
                time_s=step * self._engine.time_step_s,
            ):
                self._hold(holding)

    def _burn(self, tanks: Tanks, commands: Commands) -> Commands:
        """Return the commands that the fuel allows, and weigh the machine again without it."""
        tanks.join(self.breaking.holds)
        pushing = tanks.supply(commands.pushing, self._interval_s)
        lighter = tanks.lighter(self.breaking.clusters.cluster_of)
        if lighter is not None and not self.has_blown_up:
            self.breaking.weigh(self._engine, lighter)
        return replace(commands, pushing=pushing)

    def _hold(self, holding: Holding) -> None:
        self._engine.hold(holding.holds)
        self._engine.enter(self.breaking.clusters, self.breaking.motion)

    def _advance(self, targets: np.ndarray, firing: np.ndarray, step: int) -> None:
        if self.has_blown_up:
            return
        engine, cargo = self._engine, self._scenario.cargo
        time_s = step * engine.time_step_s
        self._blow(time_s)
        mass = cargo.mass_at(time_s) if cargo else None
        if mass is not None:
            engine.set_cargo_mass(mass)
        thrusts = recoil(self._structure, firing, self.recorder.heated_now)
        before, place = self.breaking.motion, engine.cargo() if cargo else None
        spun = None if self._field is None else self._field.spun
        engine.advance(targets, thrusts, watched=not self._is_decided)
        motion = engine.motion()
        if not (np.isfinite(motion.position).all() and np.isfinite(motion.rotation).all()):
            # Nothing more can be known; the samples say so and the scorer flags them.
            self.has_blown_up = True
            self.breaking.motion = motion
            return
        if self._is_decided:
            self.breaking.motion, self.breaking.landing = motion, None
            return
        holding = self._holding
        slipped = holding is not None and holding.follow(
            engine, time_s=time_s + self._interval_s, interval_s=self._interval_s
        )

        def repeat_finer() -> Motion:
            finer = np.repeat(targets, _FINER, axis=0)
            if self._field is not None and spun is not None:
                self._field.spun = spun
            engine.enter(self.breaking.clusters, before, cargo=place, finer=_FINER)
            engine.advance(finer, thrusts)
            if holding is not None:
                holding.read(engine)
            return engine.motion()

        interval = Interval(
            end_s=time_s + self._interval_s,
            length_s=self._interval_s,
            thrusts=thrusts,
            cargo=place,
            cargo_mass=mass,
            landing=self.breaking.landing,
        )
        self.breaking.follow(engine, motion, interval, None if slipped else repeat_finer)
        if slipped and holding is not None:
            self._hold(holding)
        landing = self.breaking.landing
        if landing is not None and landing.counts and landing.over:
            engine.push_cargo(landing.bounced)

    def _blow(self, time_s: float) -> None:
        """Set the acceleration of masses besides even gravity in the next interval."""
        field, breaking = self._field, self.breaking
        if field is not None and field.around.radius is not None:
            centers = breaking.motion.points(breaking.clusters, self._structure.centers_of_mass)
            breaking.blow(field.around.pull(centers))
        if self._wind is not None:
            wind = self._wind.at(time_s + self._interval_s / 2)
            self._engine.blow(wind)
            breaking.blow(wind)

    def _sample(self, time_s: float) -> None:
        cargo = self._scenario.cargo
        self.recorder.record(
            time_s,
            self.breaking.motion,
            self.breaking.clusters,
            self._engine.cargo() if cargo else None,
            cargo.mass_at(time_s) if cargo else None,
            bearing=self.breaking.bearing,
            loads=self.breaking.take_loads(),
        )
