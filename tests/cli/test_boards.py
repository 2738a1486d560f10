"""Boards, comparisons, exports and lists: figures, flags, dashes, and tables that fit."""

import json

import pytest
from sqlalchemy import insert, select, update
from support.clients.commands import printed, run_cli
from support.clients.terminals import on_terminal, piped
from support.stages import work

from buildarena_backend.agents.sessions import ExternalSessions
from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.database.tables import jobs, rollouts
from buildarena_cli.commands.job_lists import COLUMNS
from buildarena_cli.terminal.output import print_table

SCORES = {"openai/gpt-5": (1500.0, ["never_fell"]), "xai/grok-4": (200.0, [])}
SCORES["builtin/random"] = (900.0, ["does_not_span"])


@pytest.fixture
def sweep(context, submissions) -> None:
    """Bridges of one model carry everything, of another a little; a third one's are not bridges."""
    spec = SweepSpec(name="bridges", tasks=["support-1"], models=list(SCORES), samples=6)
    submissions.submit_sweep(spec)
    with context.store.database.transaction() as connection:
        for job in connection.execute(select(jobs)).all():
            load, flags = SCORES[job.model]
            score = {"success": 1.0, "indicator": load, "flags": flags, "metrics": {"parts": 9}}
            ended = {"state": "done", "outcome": "success", "finished_at": job.created_at}
            connection.execute(update(jobs).where(jobs.c.id == job.id).values(**ended, **score))
            trial = {"number": 0, "final": True, "engine": "pybullet", "machine_hash": "machine"}
            ended = {"job_id": job.id, "finished_at": job.created_at}
            connection.execute(insert(rollouts).values(**ended, **trial, **score))


@pytest.mark.usefixtures("sweep")
def test_boards_comparisons_and_exports_count_disqualified_ones_as_failures(url, tmp_path) -> None:
    answer = json.loads(printed(url, "leaderboard", "--json"))
    rows = {row["model"]: row["successes"] for row in answer["tasks"][0]["rows"]}
    assert list(rows.items()) == [("openai/gpt-5", 6), ("xai/grok-4", 6), ("builtin/random", 0)]
    text = printed(url, "leaderboard", "--task", "support-1")
    assert text.count("≥ 1,500.0") == 2  # the mean and the best
    overview = printed(url, "leaderboard")
    assert "flags: 6 does_not_span, 6 never_fell" in overview
    assert "  never_fell: The bridge carried everything" in overview
    assert "not_driven" not in overview
    track = answer["track"]
    assert printed(url, "compare", "openai/gpt-5", "xai/grok-4").startswith(f"Track {track}\n")
    unknown = run_cli(url, "compare", "openai/gpt-5", "x/y")
    assert (unknown.returncode, "builtin/random@" in unknown.stderr) == (1, True)
    exported = run_cli(url, "export", "--out", str(tmp_path / "board.tex"))
    assert (exported.returncode, exported.stderr) == (0, f"Track {track}\n")
    assert r"\textbf{$\geq$1500.0}" in (tmp_path / "board.tex").read_text()
    for name, says in (("board.xls", "must end in .csv"), ("no/board.csv", "can't be written")):
        refused = run_cli(url, "export", "--out", str(tmp_path / name))
        assert (refused.returncode, says in refused.stderr) == (1, True)
    listed = ("job", "list", "--flag", "never_fell")
    assert printed(url, *listed).count("≥ 1,500.00") == 6


def test_what_an_agent_did_not_report_is_null_and_a_dash_and_never_0(url, context) -> None:
    sessions = ExternalSessions(context)
    job = sessions.open(task="support-1", agent="me", seed=0, simulator="mujoco")[0].job
    sessions.call(job.id, machine="main", tool="start", arguments={})
    sessions.submit(job.id)
    work(context)
    usage = json.loads(printed(url, "job", "show", job.id, "--json"))["usage"]
    assert set(usage.values()) == {None}
    shown = printed(url, "job", "show", job.id)
    assert isinstance(json.loads(printed(url, "job", "transcript", job.id, "--json")), list | dict)
    assert "usage     - requests, - tokens in, - out, $-" in shown
    assert "actions   1, 0 refused" in shown  # what the service counts itself stays
    board = json.loads(printed(url, "leaderboard", "--json"))
    rows = {row["model"]: row for task in board["tasks"] for row in task["rows"]}
    means = [f"{name}_mean" for name in ("requests", "input_tokens", "output_tokens", "cost_usd")]
    assert [rows["agent/me"][name] for name in means] == [None] * 4
    table = printed(url, "leaderboard", "--task", "support-1")
    (line,) = [line for line in table.splitlines() if "agent/me" in line and "/1" in line]
    assert line.split()[-3:] == ["-", "-", "-"]  # requests, tokens and dollars


# Tables: whole on a terminal and through a pipe


@pytest.mark.usefixtures("sweep")
def test_rows_are_whole_however_wide_the_terminal_is(url, context) -> None:
    ids = [job.id for job in context.store.jobs.page(limit=100)]
    done = piped("job", "list", "--url", url, COLUMNS="40")
    code, shown = on_terminal(40, "job", "list", "--url", url, NO_COLOR="1")
    assert code == 0
    for text in (done.stdout, shown):
        head, *rows = text.splitlines()
        assert head.split() == list(COLUMNS)
        assert [row.split()[0] for row in rows] == ids
        assert not set("\x1b│┃─━…") & set(text)


def test_what_strangers_wrote_can_not_steer_the_terminal(capsys) -> None:
    print_table(("name",), [("\x1b[2J\x07two\nlines",), ("",)])
    assert capsys.readouterr().out.splitlines() == ["name", "\\x1b[2J\\x07two lines", "-"]
    print_table(("name", "n"), [("日本", "1"), ("abcd", "20")])
    assert capsys.readouterr().out.splitlines() == ["name   n", "日本   1", "abcd  20"]
