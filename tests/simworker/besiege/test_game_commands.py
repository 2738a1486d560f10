"""The commands about this machine's game and about what the game said."""

import sys

from typer.testing import CliRunner

from buildarena_cli.main import app

RUNNER = ["-m", "buildarena_simworker.besiege"]


def run(*words: str):
    return CliRunner().invoke(app, words)


def test_the_runners_program_takes_the_commands_place(monkeypatch, subtests) -> None:
    for words, given in [
        (["calibrate"], ["calibrate"]),
        (["calibrate", "--defaults"], ["calibrate", "--defaults"]),
        (["calibrate", "--try"], ["calibrate", "--try"]),
        (["doctor"], ["doctor"]),
        (["doctor", "--json"], ["doctor", "--json"]),
    ]:
        with subtests.test(words=words):
            started = []
            monkeypatch.setattr("os.execv", lambda *found: started.append(found))
            assert run("besiege", *words).exit_code == 0
            assert started == [(sys.executable, [sys.executable, *RUNNER, *given])]


def test_on_windows_the_program_runs_below_and_its_exit_code_counts(monkeypatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setattr("subprocess.call", lambda words: 3 if words[1:3] == RUNNER else 0)
    assert run("besiege", "doctor").exit_code == 3
