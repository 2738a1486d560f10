"""A runner of the game and the stand-in that it plays, in a folder and on a screen of their own."""

import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import psutil
from support.machines.building import BLOCK, built, experts_machine
from support.machines.families import car

from buildarena_backend.trials.trials import TrialRequest
from buildarena_benchmark import Score, Task, builtin_tasks, parse_custom_task, score
from buildarena_besiege import game_start
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, simulate
from buildarena_simulation.scenario import Control
from buildarena_simulation.sensor_config import Senses
from buildarena_simworker.besiege.calibrate import TRIAL_S
from buildarena_simworker.besiege.installed import LUA_MOD_ID

HERE = Path(__file__).parent
TESTS = HERE.parents[1]
SUPPORT = str(TESTS)
"""What programs of these tests import from."""
GAMES = TESTS / "data" / "besiege-games.zip"
"""What the stand-in says of each run; `record_games` writes it."""
TRIALS = {"transport-1": {"duration_s": 5.0}, "support-1": {"duration_s": 7.0, "ramp_s": 5.0}}
TRIALS |= {"transport-2": {"duration_s": 6.0}, "lift-2": {"duration_s": 6.0}}
"""The trials that are played in a few seconds."""
CONTROL = TESTS.parent / "examples" / "control"
STILL = "function control(t, sense)\n  return {}\nend\n"
PROGRAMS = {
    "drives": (CONTROL / "to-the-mark.lua").read_text(encoding="utf-8"),
    "fails": STILL.replace("{}", "t < 1 and {} or sense.nothing.here"),
}
"""Programs of the example's car."""
SIZE = (1280, 800)
"""Of the stand-in's window."""
GAME, MOD = "1.75-23370", "1.4"
VERSION = f"{GAME}-{MOD}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """Where a runner and its game keep their files.

    Attributes:
        folder: Everything is below it.
        speed: Game time over wall clock.
        pace: How much shorter than usual the runner's waits are.
        patience: How many times as long as usual the runner waits for the game.
    """

    folder: Path
    speed: float = 12.0
    pace: float = 8.0
    patience: float = 0.4

    def __post_init__(self) -> None:
        self.machines.mkdir(parents=True, exist_ok=True)

    @property
    def machines(self) -> Path:
        return self.folder / "SavedMachines"

    @property
    def faults(self) -> Path:
        """Faults of the game that is started next; later ones have none."""
        return self.folder / "faults.json"

    def report(self) -> dict[str, Any]:
        """What the game says of itself."""
        return json.loads((self.folder / "report.json").read_text())

    def end_game(self) -> None:
        """Ends the game that a runner left running, as a next runner would."""
        known = self.folder / "state" / "game.json"
        if known.exists():
            psutil.Process(json.loads(known.read_text())["pid"]).kill()

    def game(self, *options: str, launcher: Path | None = None) -> str:
        """The command that starts the stand-in.

        Args:
            options: Besides those of every rig.
            launcher: Where a launcher notes that it started one, which then ends; none if left out.
        """
        first = ["-m", "support.game.stand_in_game"]
        if launcher is not None:
            first = ["-m", "support.game.stand_in_game.launcher", str(launcher)]
        words = [
            *(sys.executable, *first, "--machines", str(self.machines), "--games", str(GAMES)),
            *("--speed", str(self.speed), "--report", str(self.folder / "report.json")),
            *("--faults-once", str(self.faults), *options),
        ]
        return " ".join(words)

    def environment(self) -> dict[str, str]:
        return {
            "BUILDARENA_BESIEGE_GAME": GAME,
            "BUILDARENA_BESIEGE_MOD": MOD,
            "BUILDARENA_BESIEGE_MACHINES": str(self.machines),
            "BUILDARENA_BESIEGE_STATE": str(self.folder / "state"),
            "BUILDARENA_BESIEGE_COMMAND": self.game("--level={level}"),
            "BUILDARENA_BESIEGE_PACE": str(self.pace),
            "BUILDARENA_BESIEGE_PATIENCE": str(self.patience),
            "PYTHONPATH": os.pathsep.join([SUPPORT, os.environ.get("PYTHONPATH", "")]),
        }

    def calibrate(self, **changes: Any) -> None:
        """Saves the positions at which the stand-in has its buttons, and what else is named."""
        from buildarena_simworker.besiege.screen.calibration import Calibration

        made = replace(Calibration(window=SIZE, screen=SIZE), **changes)
        made.save(self.folder / "state" / "calibration.json")


def tried_machine() -> tuple[Machine, Scenario]:
    """What `calibrate` plays to see whether the positions are right."""
    scenario = Scenario.model_validate({"duration_s": TRIAL_S, "control": {"mode": "agent"}})
    return built(("1", "A", BLOCK)), scenario


def short_trial(name: str) -> tuple[Task, Machine]:
    """A built-in task that lasts a few seconds, see `TRIALS`, and the expert's machine."""
    task, changes = builtin_tasks()[name], dict[str, Any](TRIALS[name])
    duration_s = changes.pop("duration_s")
    cargo = task.scenario.cargo and task.scenario.cargo.model_copy(update=changes)
    scenario = task.scenario.model_copy(update={"duration_s": duration_s, "cargo": cargo})
    return replace(task, scenario=scenario), experts_machine(name)


def piloted_text() -> str:
    """The example's task for programs, which lasts a few seconds."""
    text = (CONTROL / "to-the-mark.yaml").read_text(encoding="utf-8")
    return text.replace("duration_s: 20", "duration_s: 6")


def piloted_trial(name: str) -> tuple[Task, Machine]:
    """This task, and the example's car with one of `PROGRAMS`."""
    document = json.loads((CONTROL / "car.machine.json").read_text(encoding="utf-8"))
    machine = Machine.from_document(document).with_controller(PROGRAMS[name])
    return parse_custom_task(piloted_text(), origin="to-the-mark"), machine


def our_score(task: Task, machine: Machine, **more: Any) -> Score:
    """What our engine gives the machine where it starts as in the game."""
    start = game_start(machine, task.scenario)
    trajectory = simulate(machine, task.scenario, "mujoco", start=start, **more)
    return score(task, machine, trajectory)


def trial_of(
    task: Task,
    machine: Machine,
    *,
    job_id: str = "job_0001",
    version: str = VERSION,
    seed: int | None = None,
) -> TrialRequest:
    """One run of a machine, as the simulate stage asks a simulator for it."""
    given = {"task": task, "machine": machine, "version": version, "seed": seed}
    given |= {"controls": None, "require_held": lambda: None}
    return TrialRequest(job_id=job_id, number=0, token=1, **given)


MOD_XML = "<Mod>\n\t<Name>{name}</Name>\n\t<Version>{version}</Version>\n<ID>{id}</ID>\n</Mod>"


def library(tmp_path: Path, *, build: str = "25346", version: str = "1.4") -> Path:
    """A folder of Steam with the game and its mod, two levels below the workshop's folder."""
    steam = tmp_path / "steamapps"
    game = steam / "common" / "Besiege"
    mod = steam / "workshop" / "content" / "346010" / "2383785201" / "LuaScripting"
    for folder in (game / "Besiege_Data" / "SavedMachines", mod):
        folder.mkdir(parents=True, exist_ok=True)
    text = MOD_XML.format(name="Scripting", version=version, id=LUA_MOD_ID.upper())
    (mod / "Mod.xml").write_text(text, encoding="utf-8")
    other = mod.parents[1] / "1" / "Other"
    other.mkdir(parents=True, exist_ok=True)
    (other / "Mod.xml").write_text(MOD_XML.format(name="Lua toys", version="9", id="1"))
    (steam / "appmanifest_346010.acf").write_text(
        f'"AppState"\n{{\n\t"appid"\t\t"346010"\n\t"buildid"\t\t"{build}"\n}}\n'
    )
    return game


AGENT = Control(mode="agent")


def drive(duration_s: float = 2.0, **changes) -> Scenario:
    changes.setdefault("senses", Senses(offers=("pose", "wheels", "joints", "blocks")))
    return Scenario(duration_s=duration_s, control=AGENT, **changes)


def program(body: str) -> str:
    return f"function control(t, sense)\n{body}\nend"


GO = program("return { spinning_forward = 1 }")


def piloted(text: str = GO, machine: Machine | None = None) -> Machine:
    return (machine or car(bound=False, drive=())).with_controller(text)
