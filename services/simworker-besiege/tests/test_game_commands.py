"""The commands about this machine's game and about what the game said."""

import json
import sys
from datetime import UTC, datetime

import pytest
from sqlalchemy import insert, update
from support.servers.live_api import live_api
from typer.testing import CliRunner

from buildarena_cli.errors import CommandError
from buildarena_cli.main import app
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_store.tables import jobs, rollouts

TRACK = "five-role/besiege-1.75-1.4/default-0-2"
RUNNER = ["-m", "buildarena_simworker_besiege"]


def run(*words: str):
    return CliRunner().invoke(app, words)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        (["calibrate"], ["calibrate"]),
        (["calibrate", "--defaults"], ["calibrate", "--defaults"]),
        (["calibrate", "--try"], ["calibrate", "--try"]),
        (["doctor"], ["doctor"]),
        (["doctor", "--json"], ["doctor", "--json"]),
        (
            ["first-evening", "--steps", "drop,wheels", "--repeats", "2"],
            ["first-evening", "--out", "first-evening", "--steps", "drop,wheels", "--repeats", "2"],
        ),
    ],
)
def test_the_runners_program_takes_the_commands_place(monkeypatch, words, given) -> None:
    started = []
    monkeypatch.setattr("os.execv", lambda *found: started.append(found))
    assert run("besiege", *words).exit_code == 0
    assert started == [(sys.executable, [sys.executable, *RUNNER, *given])]


def test_on_windows_the_program_runs_below_and_its_exit_code_counts(monkeypatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setattr("subprocess.call", lambda words: 3 if words[1:3] == RUNNER else 0)
    assert run("besiege", "doctor").exit_code == 3


def test_the_agreement_of_engines_and_game_is_shown(context, submissions) -> None:
    with live_api(context) as url:
        nothing = run("besiege", "agreement", "--url", url)
        assert isinstance(nothing.exception, CommandError)
        assert "no job was scored in the game yet" in str(nothing.exception)
        _tried(context, submissions)
        shown = run("besiege", "agreement", "--url", url)
        assert shown.exit_code == 0, shown.output
        assert "mujoco" in shown.stdout
        assert "100% (3% to 100%)" in shown.stdout
        found = json.loads(run("besiege", "agreement", "--url", url, "--json").stdout)
    assert found["track"] == TRACK
    assert [row["trials"] for row in found["rows"]] == [1]


def _tried(context, submissions) -> None:
    job, _ = submissions.submit_job(JobSpec(task="support-1", model="builtin/idle"))
    now = datetime.now(UTC)
    ended = {"state": "done", "outcome": "success", "success": True, "indicator": 5.0}
    said = {"success": True, "indicator": 5.5, "flags": [], "simulation": "3"}
    with context.store.database.transaction() as connection:
        connection.execute(
            update(jobs)
            .where(jobs.c.id == job.id)
            .values(track=TRACK, metrics={}, flags=[], finished_at=now, **ended)
        )
        connection.execute(
            insert(rollouts).values(
                job_id=job.id,
                number=0,
                final=True,
                engine="besiege",
                machine_hash="0" * 64,
                success=True,
                indicator=5.0,
                annotations={"mujoco": said},
                finished_at=now,
            )
        )
