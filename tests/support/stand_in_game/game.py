"""The game behind the window: what is loaded, what runs, what the log says."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from buildarena_simulation import BuildarenaSimulationError
from buildarena_simulation.scenario import TerrainBox
from stand_in_game.faults import Fault, Faults
from stand_in_game.log_window import LogWindow
from stand_in_game.machine_file import FileMachine, GameFileError, read_machine_file
from stand_in_game.script import Script, ScriptError
from stand_in_game.stage import Stage, as_built, rehearse
from stand_in_game.trial import UPDATES_PER_S, Flight, Inputs, Part, Placed, holds

_LONGEST_FRAME_S: Final = 0.25
"""A frame that took longer than this makes the game lag instead of jump."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the game runs.

    Attributes:
        terrain: the level's boxes.
        speed: game time over the wall clock.
        log_lines: how many lines the log window keeps.
        horizon_s: how much of a simulation is worked out.
        load_s: how long a machine takes to load, wall clock.
        seed: draws everything random.
        log_file: where the log is written as well.
    """

    terrain: tuple[TerrainBox, ...] = ()
    speed: float = 1.0
    log_lines: int = 400
    horizon_s: float = 36.0
    load_s: float = 0.3
    seed: int = 0
    log_file: Path | None = None


class Rollout:
    """A machine's flight, worked out beside the window.

    Args:
        work: makes the flight.
    """

    def __init__(self, work: Callable[[], Flight]) -> None:
        self.flight: Flight | None = None
        self.error = ""
        self._work = work
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def ready(self) -> bool:
        """Whether the flight, or the reason why there is none, is known."""
        return self.flight is not None or self.error != ""

    def _run(self) -> None:
        try:
            self.flight = self._work()
        except (BuildarenaSimulationError, ValueError) as error:
            self.error = str(error) or type(error).__name__


class Game:
    """The state of the game; the window and the headless server move it.

    Args:
        settings: how it runs.
        faults: what goes wrong.
        scripted: whether machines' scripts are run.
    """

    def __init__(self, settings: Settings, faults: Faults, *, scripted: bool = True) -> None:
        self.settings, self.faults = settings, faults
        self._scripted = scripted
        self.terrain = settings.terrain
        self._draw = random.Random(settings.seed)
        self.log = LogWindow(settings.log_lines, settings.seed, settings.log_file)
        self.machine_name: str | None = None
        self.placed: Placed | None = None
        self.grounded = False
        self.simulating = False
        self.message = ""
        self.counts = dict.fromkeys(("loads", "starts", "stops", "deletes", "copies"), 0)
        self.stage: Stage | None = None
        self._rollout: Rollout | None = None
        self._script: Script | None = None
        self._run_faults: list[Fault] = []
        self._printed: list[str] = []
        self._clock_s = 0.0

    def load(self, path: Path) -> bool:
        """Loads a machine in place of the present one; whether that worked."""
        try:
            file = read_machine_file(path)
            self._place(file, on_ground=False)
        except (OSError, GameFileError, BuildarenaSimulationError, ValueError) as error:
            self.message = f"could not load {path.stem}: {error}"
            return False
        self.machine_name, self.message = path.stem, ""
        self.counts["loads"] += 1
        return True

    def set_ground(self) -> None:
        """Puts the machine on the floor."""
        if self.placed is not None and not self.simulating:
            self._place(self.placed.file, on_ground=True)

    def delete(self) -> None:
        """Removes the machine."""
        if self.placed is not None:
            self.counts["deletes"] += 1
        self.machine_name = self.placed = self._rollout = None
        self.grounded = False

    def start(self) -> list[Fault]:
        """Starts the simulation, if there is a machine; the faults that strike then."""
        if self.placed is None or self.simulating:
            return []
        self.simulating, self._clock_s = True, 0.0
        self.counts["starts"] += 1
        self._run_faults = self.faults.at("start")
        self._printed = []
        self.log.clear()
        placed = self.placed
        self.stage = Stage(placed.file, self._part, placed.rebuilt.cargo)
        self._script = None
        if self._scripted and placed.file.script is not None:
            text, stage = placed.file.script, self.stage
            self._run_script(lambda: self._load_script(text, stage))
            self._call("play")
        return self._run_faults

    def stop(self) -> None:
        """Ends the simulation; the machine is as it was built."""
        if self.simulating:
            self.counts["stops"] += 1
        if self.placed is not None and self._by_hand:
            self._place(self.placed.file, on_ground=self.grounded)
        self.simulating, self._script, self.stage = False, None, None

    def frame(self, passed_s: float) -> None:
        """One frame of the game.

        Args:
            passed_s: wall-clock time since the last one.
        """
        stage, rollout = self.stage, self._rollout
        if not self.simulating or stage is None or rollout is None or not rollout.ready:
            return
        if rollout.error:
            self.message = f"no physics for this machine: {rollout.error}"
        self._clock_s += min(passed_s, _LONGEST_FRAME_S) * self.settings.speed * self._pace()
        # All updates that are due come at once, as at a real game's frame.
        while stage.update < int(self._clock_s * UPDATES_PER_S + 1e-6):
            self._fixed_update(stage)
        for name in ("update", "late_update", "on_gui"):
            self._call(name)
        self.log.append(self._printed, self._run_faults)
        self._printed = []

    @property
    def _by_hand(self) -> bool:
        """Whether keys were pressed by hand: then no other simulation goes like this one."""
        return not self._scripted and self.stage is not None and bool(self.stage.edges)

    @property
    def time_s(self) -> float:
        """Game time since the simulation's start, seconds."""
        return self.stage.time_s if self.stage is not None else 0.0

    @property
    def rollout_ready(self) -> bool:
        """Whether the loaded machine's simulation is worked out."""
        return self._rollout is not None and self._rollout.ready

    @property
    def flight(self) -> Flight | None:
        """The simulation of the loaded machine, once it is known."""
        return self._rollout.flight if self._rollout is not None else None

    def part(self, place: int) -> Part:
        """A block of the loaded machine as it is now."""
        return self._part(place, self.time_s)

    def hold(self, key: str, *, down: bool) -> None:
        """Presses or lets go a key by hand: what comes is worked out again from the start."""
        if self.placed is None or self.stage is None:
            return
        self.stage.press(key.lower(), down)
        placed, seconds = self.placed, self.settings.horizon_s
        inputs = Inputs(presses=holds(self.stage.edges, seconds))
        self._rollout = Rollout(lambda: self._fly(placed, inputs))

    def play_in(self, terrain: tuple[TerrainBox, ...]) -> None:
        """Changes the level."""
        self.terrain = terrain
        if self.placed is not None:
            self._place(self.placed.file, on_ground=self.grounded)

    def _place(self, file: FileMachine, *, on_ground: bool) -> None:
        placed = Placed(file, on_ground=on_ground)
        self.placed, self.grounded = placed, on_ground
        self._rollout = Rollout(lambda: self._fly(placed, self._inputs(placed)))

    def _inputs(self, placed: Placed) -> Inputs:
        if not self._scripted:
            return Inputs()
        return rehearse(placed, duration_s=self.settings.horizon_s)

    def _fly(self, placed: Placed, inputs: Inputs) -> Flight:
        return Flight(placed, self.terrain, inputs, duration_s=self.settings.horizon_s)

    def _part(self, place: int, time_s: float) -> Part:
        assert self.placed is not None
        flight = self.flight
        if not self.simulating or flight is None:
            return as_built(self.placed, place)
        return flight.part(place, time_s)

    def _pace(self) -> float:
        pace = 1.0
        for fault in self._run_faults:
            if fault.kind == "lag":
                pace *= self._draw.uniform(0.0, 2.0 / fault.number("slowness", 3.0))
        return pace

    def _fixed_update(self, stage: Stage) -> None:
        for fault in self._run_faults:
            if fault.kind == "lua_error" and stage.update + 1 == fault.number("update", 200):
                self._fail(fault.text("main.lua:1: attempt to index a nil value"))
        if self._script is None:
            stage.update += 1
        else:
            script = self._script
            self._run_script(lambda: stage.fixed_update(script))

    def _load_script(self, text: str, stage: Stage) -> None:
        self._script = Script(text, stage, self._printed_line)

    def _printed_line(self, line: str) -> None:
        self._printed.extend(line.split("\n"))

    def _call(self, name: str) -> None:
        if self._script is not None:
            script = self._script
            self._run_script(lambda: script.call(name))

    def _run_script(self, work: Callable[[], None]) -> None:
        try:
            work()
        except ScriptError as error:
            self._fail(str(error))

    def _fail(self, why: str) -> None:
        """A script that fails says so and is called no more; the game goes on."""
        if self._script is not None or "main.lua" in why:
            self._printed.append(f"Lua error: {why}")
        self._script = None
