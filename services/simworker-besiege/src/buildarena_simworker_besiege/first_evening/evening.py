"""Plays the steps one after the other, and packs what came of them."""

from __future__ import annotations

import getpass
import os
import platform
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from buildarena_besiege import GameLog
from buildarena_pipeline import __version__
from buildarena_pipeline.evidence import (
    FORMAT,
    STEPS,
    Evidence,
    EvidenceError,
    StepRecord,
    Versions,
    judged,
    step_named,
    write_evidence,
)
from buildarena_pipeline.evidence.document import MAX_RUNS
from buildarena_pipeline.evidence.reading_runs import StepInputs
from buildarena_simworker_besiege.first_evening.folder import EveningsFolder
from buildarena_simworker_besiege.first_evening.game import EveningsGame
from buildarena_simworker_besiege.first_evening.playing import StepDone, perform
from buildarena_simworker_besiege.installed import installed
from buildarena_simworker_besiege.settings import BesiegeSettings

SECRET: Final = ("KEY", "TOKEN", "SECRET", "PASSWORD")
REPEATS: Final = 3

Tell = Callable[[str], None]


def first_evening(
    settings: BesiegeSettings,
    out: Path,
    *,
    steps: Sequence[str] = (),
    repeats: int = REPEATS,
    tell: Tell,
) -> Evidence:
    """Plays what is not done yet, and writes the evidence; see `EveningsFolder.archive`.

    A step that is done stays so; one that failed or was left out is tried again.

    Args:
        settings: How the game is driven.
        out: The evening's folder.
        steps: Names of the steps to play; all of them if left out. Others that are done already
            are packed as well.
        repeats: How often the expert's machines are played.
        tell: Shows a line.

    Raises:
        EvidenceError: There is no such step, or the number of repeats cannot be; nothing is played.
    """
    for name in steps:
        step_named(name)
    if not 1 <= repeats <= MAX_RUNS:
        raise EvidenceError(f"--repeats is {repeats}: it goes from 1 to {MAX_RUNS}")
    settings, versions = _versions(settings)
    game = EveningsGame(settings)
    folder = EveningsFolder(out, versions, game.driver)
    hidden = _hidden()
    try:
        for name in steps or STEPS:
            stored = folder.stored(name)
            if stored is not None and stored.record.state == "done":
                tell(f"{name}: was done before")
                continue
            done = perform(STEPS[name], game, repeats=repeats, hidden=hidden)
            folder.store(done)
            tell(_line(_judged(done, versions, game.driver)))
    finally:
        game.close()
    return _pack(folder, versions, game.driver)


def _pack(folder: EveningsFolder, versions: Versions, driver: Any) -> Evidence:
    stored = {name: done for name in STEPS if (done := folder.stored(name)) is not None}
    evidence = Evidence(
        format=FORMAT,
        made_at=datetime.now(UTC).replace(microsecond=0),
        versions=versions,
        driver=driver,
        screen=_screen(stored.values()),
        steps=tuple(_judged(done, versions, driver) for done in stored.values()),
    )
    files = {
        f"steps/{name}/{file}": data
        for name, done in stored.items()
        for file, data in done.files.items()
    }
    folder.write(write_evidence(evidence, files))
    return evidence


def _judged(done: StepDone, versions: Versions, driver: str) -> StepRecord:
    return judged(
        StepInputs(record=done.record, files=done.files, versions=versions, driver=driver)
    )


def _screen(steps: Any) -> tuple[int, int] | None:
    """What the game said that it draws, in the first log that has it."""
    for done in steps:
        for run in done.record.runs:
            log = GameLog(run.run_id)
            log.read(done.files.get(f"log-{run.number}.txt", b"").decode("utf-8", "replace"))
            if log.world is not None:
                return log.world.screen
    return None


def _versions(settings: BesiegeSettings) -> tuple[BesiegeSettings, Versions]:
    """Settings that name versions, if need be those of files; and what evidence says of them."""
    present = installed(settings.folder)
    game = settings.game or f"build-{present.build or 'unknown'}"
    mod = settings.mod or present.mod or "unknown"
    versions = Versions(
        buildarena=__version__, game=game, mod=mod, build=present.build, mod_file=present.mod
    )
    return settings.model_copy(update={"game": game, "mod": mod}), versions


def _hidden() -> tuple[str, ...]:
    """What must not stand in evidence: names of person and machine, and keys."""
    try:
        person = getpass.getuser()
    except (OSError, KeyError, ImportError):
        person = ""
    keys = [text for name, text in os.environ.items() if any(word in name for word in SECRET)]
    return (person, platform.node(), *keys)


def _line(record: StepRecord) -> str:
    state = record.state.replace("_", " ")
    if record.state != "done":
        return f"{record.name}: {state}: {record.detail}"
    counts = Counter(entry.verdict.replace("_", " ") for entry in record.judgements)
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    return f"{record.name}: {state}: {verdicts}"
