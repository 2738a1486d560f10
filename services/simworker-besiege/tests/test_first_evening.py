"""A first evening with the stand-in game: every kind of step, failures, kill and resumption."""

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from game_rig import Rig

from buildarena_pipeline.evidence import EvidenceError, StepRecord, Verdict, read_evidence
from buildarena_simworker_besiege.errors import DesktopError
from buildarena_simworker_besiege.first_evening import evening, first_evening
from buildarena_simworker_besiege.first_evening.playing import StepDone
from buildarena_simworker_besiege.settings import BesiegeSettings

pytestmark = pytest.mark.nightly

PROGRAM = [sys.executable, "-m", "buildarena_simworker_besiege", "first-evening"]
QUICK = "doctor,calibration"


def environment(rig: Rig, screen: dict[str, str]) -> dict[str, str]:
    return {**os.environ, **rig.environment(), **screen, "BUILDARENA_KEY": "ba_secret_of_a_person"}


def words(rig: Rig, *more: str) -> list[str]:
    return [*PROGRAM, "--out", str(rig.folder / "evening"), "--repeats", "1", *more]


def played(rig: Rig, screen: dict[str, str], *more: str) -> str:
    """What the program says; whether it failed is the steps' business."""
    done = subprocess.run(
        words(rig, *more),
        env=environment(rig, screen),
        capture_output=True,
        text=True,
        timeout=230,
        check=False,
    )
    assert done.returncode in {0, 1}, done.stderr
    return done.stdout


def archive(rig: Rig) -> Path:
    return rig.folder / "evening" / "evidence.zip"


def verdicts(rig: Rig) -> dict[tuple[str, str], Verdict]:
    evidence = read_evidence(archive(rig).read_bytes()).evidence
    return {
        (step.name, entry.assumption): entry.verdict
        for step in evidence.steps
        for entry in step.judgements
    }


def settings(rig: Rig, **changes: object) -> BesiegeSettings:
    own = {"machines": rig.machines, "state": rig.folder / "state", **changes}
    return BesiegeSettings.model_validate(own)


def test_an_evening_is_played_packed_and_judged(rig, screen) -> None:
    slow = replace(rig, speed=1.2, patience=2.0)
    said = played(slow, screen, "--steps", "doctor,calibration,sampler,drop,scales")
    # It prints a hundred lines a second, of which the log's window has room for three hundred.
    said += played(replace(slow, speed=0.6), screen, "--steps", "program")
    fast = replace(rig, speed=6.0, patience=2.0)
    said += played(fast, screen, "--steps", "probe,wheels,expert-transport-1,expert-support-1")
    assert set(verdicts(rig).values()) == {Verdict.CONFIRMED, Verdict.NOT_SEEN}, said
    assert [k for k, v in verdicts(rig).items() if v is Verdict.NOT_SEEN] == [
        ("probe", "mass_slider")
    ]
    with zipfile.ZipFile(archive(rig)) as packed:
        names = packed.namelist()
        texts = b"".join(packed.read(name) for name in names if not name.endswith(".png"))
    assert "steps/sampler/saved-1.bsg" in names
    assert "steps/calibration/picture-started.png" in names
    for secret in (str(rig.folder), "ba_secret_of_a_person", "/home/", "/tmp/"):
        assert secret.encode() not in texts
    assert not list(rig.machines.iterdir())


def test_a_dialog_in_the_way_fails_its_step_with_a_picture_and_the_next_goes_on(
    rig, screen, monkeypatch
) -> None:
    always = [{"fault": "dialog", "at": "save_machine", "times": None}]
    stubborn = rig.folder / "stubborn.py"
    stubborn.write_text(
        f"import os, pathlib, sys\n"
        f"pathlib.Path({str(rig.faults)!r}).write_text({json.dumps(always)!r})\n"
        f"words = {rig.game().split()!r}\n"
        f"os.execv(words[0], [*words, *sys.argv[1:]])\n"
    )
    command = f"{sys.executable} {stubborn} --level={{level}}"
    changed = {**rig.environment(), "BUILDARENA_BESIEGE_COMMAND": command}
    monkeypatch.setattr(Rig, "environment", lambda _: changed)
    said = played(rig, screen, "--steps", "sampler,doctor")
    assert "sampler: failed: save the machine " in said
    assert "doctor: done: 1 confirmed" in said
    evidence = read_evidence(archive(rig).read_bytes()).evidence
    sampler = next(step for step in evidence.steps if step.name == "sampler")
    assert {entry.verdict for entry in sampler.judgements} == {Verdict.NOT_SEEN}
    with zipfile.ZipFile(archive(rig)) as packed:
        assert any("picture-fault-" in name for name in packed.namelist())


def test_a_killed_evening_goes_on_where_it_stopped(rig, screen) -> None:
    fast = replace(rig, speed=6.0, patience=2.0)
    program = subprocess.Popen(
        words(fast, "--steps", f"{QUICK},wheels"),
        env=environment(fast, screen),
        stdout=subprocess.DEVNULL,
    )
    record = rig.folder / "evening" / "steps" / "calibration" / "record.json"
    ends = time.monotonic() + 60
    while not record.exists():
        assert time.monotonic() < ends
        time.sleep(0.05)
    program.send_signal(signal.SIGKILL)
    program.wait()
    assert not archive(rig).exists()
    said = played(fast, screen, "--steps", f"{QUICK},wheels")
    assert "doctor: was done before" in said
    assert "calibration: was done before" in said
    assert "wheels: done: 1 confirmed" in said
    assert not list(rig.machines.iterdir())


def test_without_a_game_each_step_says_so_and_the_next_goes_on(rig) -> None:
    said: list[str] = []
    made = first_evening(
        settings(rig, machines=None), rig.folder / "out", steps=["drop", "probe"], tell=said.append
    )
    assert [step.state for step in made.steps] == ["failed", "failed"]
    assert all("there is no folder of machine files" in line for line in said)
    assert {entry.verdict for step in made.steps for entry in step.judgements} == {Verdict.NOT_SEEN}


def test_what_a_driver_cannot_do_is_left_out_and_says_why(rig) -> None:
    said: list[str] = []
    made = first_evening(
        settings(rig, driver="toolkit", command="python -m nothing {folder}"),
        rig.folder / "out",
        steps=["calibration", "sampler", "probe", "expert-support-1"],
        tell=said.append,
    )
    left = {step.name: step.detail for step in made.steps if step.state == "left_out"}
    assert set(left) >= {"calibration", "sampler", "probe"}
    assert left["probe"] == "it needs the game's window, and the game is driven by toolkit"


def test_unknown_steps_and_repeats_are_refused_before_anything_is_played(rig) -> None:
    with pytest.raises(EvidenceError, match=r"no step 'drpo'; there are doctor"):
        first_evening(settings(rig), rig.folder / "out", steps=["drpo"], tell=print)
    with pytest.raises(EvidenceError, match=r"--repeats is 0: it goes from 1 to 20"):
        first_evening(settings(rig), rig.folder / "out", repeats=0, tell=print)
    assert not (rig.folder / "out").exists()


def test_failed_steps_are_tried_again_and_done_ones_are_not(rig, monkeypatch) -> None:
    calls: list[str] = []

    def perform(step, *_, **__):
        calls.append(step.name)
        state = "failed" if step.name == "drop" and len(calls) < 3 else "done"
        return StepDone(record=StepRecord(name=step.name, state=state))

    monkeypatch.setattr(evening, "perform", perform)
    for _ in range(2):
        first_evening(settings(rig), rig.folder / "out", steps=["doctor", "drop"], tell=print)
    assert calls == ["doctor", "drop", "drop"]
    other = settings(rig, game="1.90", mod="2")
    first_evening(other, rig.folder / "out", steps=["doctor"], tell=print)
    assert calls[3:] == ["doctor"]


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (DesktopError("cannot write /home/ann/besiege/x.bsg"), "cannot write (path)"),
        (TypeError("no number"), "TypeError: no number"),
    ],
)
def test_an_error_is_a_sentence_without_paths(rig, monkeypatch, error, sentence) -> None:
    def examine(_):
        raise error

    monkeypatch.setattr("buildarena_simworker_besiege.first_evening.playing.examine", examine)
    made = first_evening(settings(rig), rig.folder / "out", steps=["doctor"], tell=print)
    assert (made.steps[0].state, made.steps[0].detail) == ("failed", sentence)
