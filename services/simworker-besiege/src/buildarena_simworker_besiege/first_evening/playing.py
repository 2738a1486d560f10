"""How each kind of step is done; what goes wrong becomes a sentence, and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import structlog

from buildarena_benchmark import paper_tasks
from buildarena_besiege import game_start
from buildarena_pipeline.errors import PermanentError
from buildarena_pipeline.evidence import Measured, RunRecord, Step, StepRecord, Trial, trial_named
from buildarena_pipeline.evidence.document import EngineRecord, Point
from buildarena_pipeline.evidence.packing import without_paths
from buildarena_pipeline.evidence.reading_runs import figures_of
from buildarena_pipeline.runtime.simulators.simulator import (
    MachineRefusedError,
    SimulatorFaultError,
    TrialRequest,
    TrialResult,
)
from buildarena_simulation import ENGINES, BuildarenaSimulationError, simulate
from buildarena_simworker_besiege.calibrate import learnt, opened_terrain, try_out
from buildarena_simworker_besiege.doctor import examine
from buildarena_simworker_besiege.errors import DesktopError, NeedsPersonError, NotSetUpError
from buildarena_simworker_besiege.first_evening.game import EveningsGame
from buildarena_simworker_besiege.installed import installed
from buildarena_simworker_besiege.play import Played
from buildarena_simworker_besiege.screen.calibration import load_calibration
from buildarena_simworker_besiege.screen.window_types import Wanted

log = structlog.get_logger(__name__)

KINDS: Final = ("machine", "script", "log")
"""Files of a run that evidence has; other drivers' further ones stay away."""


@dataclass(slots=True, kw_only=True)
class StepDone:
    """What came of a step.

    Attributes:
        record: What is noted of it, not judged yet.
        files: Its files by name.
    """

    record: StepRecord
    files: dict[str, bytes] = field(default_factory=dict)


def perform(step: Step, game: EveningsGame, *, repeats: int, hidden: tuple[str, ...]) -> StepDone:
    """Does a step; nothing that goes wrong in the game ends the evening.

    Args:
        step: The step.
        game: The game.
        repeats: How often a step that is repeated is played.
        hidden: Names and keys that must not stand in sentences.
    """
    done = StepDone(record=StepRecord(name=step.name, state="done"))
    if step.window and game.driver != "window":
        why = f"it needs the game's window, and the game is driven by {game.driver}"
        return _ended(done, "left_out", why, hidden)
    try:
        _WAYS[step.way](step, game, done, repeats)
    except SimulatorFaultError as fault:
        pictures = (file.data for name, file in fault.files.items() if name.endswith(".png"))
        done.files |= {f"picture-fault-{n}.png": data for n, data in enumerate(pictures, 1)}
        return _ended(done, "left_out" if fault.endless else "failed", fault, hidden)
    except (PermanentError, NeedsPersonError) as error:
        return _ended(done, "left_out", error, hidden)
    except (MachineRefusedError, NotSetUpError, DesktopError, OSError) as error:
        return _ended(done, "failed", error, hidden)
    except Exception as error:
        # Whatever it is, the next step may be none of its business.
        log.exception("step_failed", step=step.name)
        return _ended(done, "failed", f"{type(error).__name__}: {error}", hidden)
    finally:
        _collect_pictures(step, game, done)
    done.record = _without_names(done.record, hidden)
    return done


def _without_names(record: StepRecord, hidden: tuple[str, ...]) -> StepRecord:
    """A record in whose sentences no path and no name stands."""
    runs = tuple(
        run.model_copy(update={"faults": tuple(without_paths(f, hidden) for f in run.faults)})
        for run in record.runs
    )
    points = tuple(
        point.model_copy(update={"detail": without_paths(point.detail, hidden)})
        for point in record.points
    )
    return record.model_copy(update={"runs": runs, "points": points})


def _examined(step: Step, game: EveningsGame, done: StepDone, repeats: int) -> None:  # noqa: ARG001
    points = tuple(
        Point(name=entry.name, ok=entry.ok, detail=without_paths(entry.detail))
        for entry in examine(game.settings)
    )
    done.record = done.record.model_copy(update={"points": points})


def _tried(step: Step, game: EveningsGame, done: StepDone, repeats: int) -> None:  # noqa: ARG001
    settings, watched = game.settings, game.watched
    watched.forget()
    watched.takes_pictures = True
    lines: list[str] = []
    terrain = opened_terrain(settings)
    played = try_out(game.desktop, settings.time_limits, lines.append, terrain)
    if played is None:
        raise DesktopError("; ".join(lines))
    _learn(game, played)
    done.files["log-1.txt"] = played.log.text().encode()
    done.files["machine-1.bsg"] = played.run.machine_file
    run = RunRecord(
        number=1,
        run_id=played.run.run_id,
        measured=watched.measured(round(played.pace, 2)),
        faults=played.faults,
    )
    done.record = done.record.model_copy(update={"runs": (run,)})


def _learn(game: EveningsGame, played: Played) -> None:
    """Notes what the run showed, as `calibrate --try` does."""
    from buildarena_simworker_besiege.screen.windows import open_windows

    settings = game.settings
    windows = open_windows(Wanted(title=settings.title, executable=settings.executable))
    before = load_calibration(settings.calibration_file)
    after = learnt(before, played, windows, installed(settings.folder))
    after.save(settings.calibration_file)


def _played(step: Step, game: EveningsGame, done: StepDone, repeats: int) -> None:
    trial = trial_named(step.trial)
    if game.driver != "toolkit":
        game.watched.forget()
    for number in range(1, (repeats if step.repeated else 1) + 1):
        _play(trial, game, done, number)
    if step.beside_engines:
        done.record = done.record.model_copy(update={"engines": dict(_engines(trial))})


def _saved(step: Step, game: EveningsGame, done: StepDone, repeats: int) -> None:  # noqa: ARG001
    watched = game.watched
    watched.forget()
    watched.saves = watched.takes_pictures = True
    try:
        _play(trial_named(step.trial), game, done, 1)
    finally:
        if watched.saved is not None:
            done.files["saved-1.bsg"] = watched.saved


def _play(trial: Trial, game: EveningsGame, done: StepDone, number: int) -> None:
    result = game.play(_request(trial, game, number))
    versions = result.versions
    pace = float(versions.get("pace", 0.0))
    measured = Measured(pace=pace) if game.driver == "toolkit" else game.watched.measured(pace)
    run = RunRecord(
        number=number,
        run_id=str(versions["run"]),
        measured=measured,
        faults=tuple(without_paths(fault) for fault in versions.get("faults", ()))[:20],
    )
    done.record = done.record.model_copy(update={"runs": (*done.record.runs, run)})
    done.files |= dict(_files(result))


def _files(result: TrialResult) -> Iterator[tuple[str, bytes]]:
    for name, file in result.files.items():
        if name.partition("-")[0] in KINDS:
            yield name, file.data


def _request(trial: Trial, game: EveningsGame, number: int) -> TrialRequest:
    # Playing asks a task for its scenario only.
    task = trial.task or replace(next(iter(paper_tasks().values())), scenario=trial.scenario)
    return TrialRequest(
        job_id=f"evening_{trial.name.replace('-', '')[:10]}",
        number=number,
        token=number,
        version=game.settings.version or "",
        task=task,
        machine=trial.machine,
        controls=None,
        require_held=lambda: None,
    )


def _engines(trial: Trial) -> Iterator[tuple[str, EngineRecord]]:
    """What our engines make of a trial; one that is not installed says nothing."""
    for engine in ENGINES:
        try:
            start = game_start(trial.machine, trial.scenario)
            trajectory = simulate(trial.machine, trial.scenario, engine, start=start)
        except BuildarenaSimulationError:
            continue
        figures = figures_of(trial, trial.machine, trajectory)
        yield engine, EngineRecord(simulation=trajectory.simulation_version, figures=figures)


def _collect_pictures(step: Step, game: EveningsGame, done: StepDone) -> None:
    if step.window and game.driver == "window" and step.way in {"try", "save"} and game.is_open:
        pictures: Mapping[str, bytes] = game.watched.pictures
        done.files |= {f"picture-{moment}.png": data for moment, data in pictures.items()}


def _ended(done: StepDone, state: Any, why: object, hidden: tuple[str, ...]) -> StepDone:
    update = {"state": state, "detail": without_paths(why, hidden), "engines": {}}
    done.record = _without_names(done.record.model_copy(update=update), hidden)
    return done


_WAYS: Final[Mapping[str, Callable[[Step, EveningsGame, StepDone, int], None]]] = {
    "examine": _examined,
    "try": _tried,
    "play": _played,
    "save": _saved,
}
