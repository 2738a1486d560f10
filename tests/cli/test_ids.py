"""Ids: a unique prefix is enough, and nonsense leads no request to another route."""

import asyncio
import json
from pathlib import Path

import pytest
from mcp.types import CallToolRequestParams
from support.clients.commands import printed, run_cli
from support.jobs import attach, claim, finish
from support.servers.wrong_server import answer, wrong_server

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_cli.commands.jobs import file_name
from buildarena_cli.errors import CommandError
from buildarena_cli.ids import checked_id
from buildarena_cli.mcp_server import make_server
from buildarena_client import Client

JSON = "application/json"
JOB = "job_0a1b2c3d4e5f60718293"
CANCELS = "../sweeps/sweep_0a1b2c3d4e5f60718293/cancel#"


@pytest.fixture
def sweep(submissions) -> str:
    models = ["builtin/idle", "builtin/random"]
    spec = SweepSpec(tasks=["support-1", "lift-1"], models=models, samples=8)
    return str(submissions.submit_sweep(spec).sweep.id)


@pytest.fixture
def ids(sweep, context) -> list[str]:
    assert sweep
    return sorted(job.id for job in context.store.jobs.page(limit=100))


def test_a_unique_prefix_is_enough_and_an_ambiguous_one_refused(url, ids, sweep) -> None:
    wanted = ids[0]
    prefix = next(
        wanted[:n] for n in range(5, 25) if not any(o.startswith(wanted[:n]) for o in ids[1:])
    )
    for word in (prefix, prefix.removeprefix("job_")):
        assert json.loads(printed(url, "job", "show", word, "--json"))["id"] == wanted
    assert json.loads(printed(url, "sweep", "status", sweep[:9], "--json"))["id"] == sweep
    assert json.loads(printed(url, "job", "list", "--sweep", sweep[6:10], "--json"))["data"]
    doubled = next(p for p in "0123456789abcdef" if sum(i[4] == p for i in ids) > 1)
    done = run_cli(url, "job", "cancel", doubled)
    assert done.returncode == 1
    assert {id_ for id_ in ids if id_ in done.stderr} == {i for i in ids if i[4] == doubled}
    digits = "0123456789abcdef"
    missing = next(a + b for a in "0f" for b in digits if not any(i[4:6] == a + b for i in ids))
    assert f"no job's id begins with 'job_{missing}'" in run_cli(url, "job", "show", missing).stderr


def test_jobs_are_filtered_and_pages_follow_each_other(url, ids, context, subtests) -> None:
    found = finish(context, claim(context), "unsuccessful", reason="too_weak", flags=("odd",))
    words = ["--reason", "too_weak", "--flag", "odd", "--outcome", "unsuccessful"]
    _, row = printed(url, "job", "list", *words).splitlines()
    assert row.split()[0] == found
    for words, says in (
        (["--task", "lift-9"], "did you mean lift-"),
        (["--model", "builtin/idel"], "did you mean builtin/idle?"),
        (["--outcome", "sucess"], "did you mean success"),
    ):
        with subtests.test(says=says):
            done = run_cli(url, "job", "list", *words)
            assert (done.returncode, says in done.stderr) == (1, True), done.stderr
    first = run_cli(url, "job", "list", "--limit", "20")
    assert (len(first.stdout.splitlines()), "--all" in first.stderr) == (21, True)
    whole = run_cli(url, "job", "list", "--limit", "3", "--all")
    rows = whole.stdout.splitlines()[1:]
    assert (sorted(row.split()[0] for row in rows), whole.stderr) == (ids, "")


def test_a_jobs_files_are_fetched_whole_or_not_at_all(url, sweep, context, tmp_path) -> None:
    assert sweep
    lease = claim(context)
    files = {"machine": b"{}", "transcript": b"[]", "trajectory-0": b"PAR1"}
    attach(context, lease.job.id, files, JSON)
    job = finish(context, lease, "unsuccessful")
    _, *rows = printed(url, "job", "files", job).splitlines()
    assert [row.split()[0] for row in rows] == sorted(files)
    out = tmp_path / "some" / "folder"
    printed(url, "job", "files", job, "--out", str(out))
    assert {f.stem: f.read_bytes() for f in out.iterdir()} == files
    printed(url, "job", "files", job, "machine", "--out", str(tmp_path / "one"))
    assert [f.name for f in (tmp_path / "one").iterdir()] == ["machine.json"]
    assert "did you mean machine?" in run_cli(url, "job", "files", job, "machin").stderr
    for name, safe in (
        ("../../etc/passwd", "_.._etc_passwd.json"),
        (".hidden", "hidden.json"),
        ("a/b\\c:d\x00", "a_b_c_d_.json"),
        ("...", "file.json"),
        ("x.json", "x.json"),
    ):
        assert file_name(name, JSON) == safe == Path(safe).name


def test_nonsense_is_no_id_and_no_other_path_is_ever_sent(url) -> None:
    """Whether a person or a model gives it."""
    for given in (None, 5, ["x"], {}, JOB + "\n", JOB.upper(), "job_", "sweep_0", CANCELS):
        with pytest.raises(CommandError, match="is not the id of a job"):
            checked_id("job", given)
    assert checked_id("job", JOB) == JOB
    with wrong_server(answer(200)) as server:
        client = Client(server.url)
        for word in ("../sweeps/x/cancel#", "", "x" * 5000, "job_0\n", "é", "."):
            for name in ("cancel", "files", "transcript"):
                done = run_cli(server.url, "job", name, word)
                assert (done.returncode, "is not the id of a job" in done.stderr) == (1, True)
        handler = make_server(client).get_request_handler("tools/call")
        for tool in ("start", "submit", "get_result"):
            call = CallToolRequestParams(name=tool, arguments={"session": CANCELS})
            assert asyncio.run(handler.handler(None, call)).is_error, "a model cancels no sweep"
        for word in ("..", "../jobs", "a/b", ""):
            assert f"{word!r} is not a name" in run_cli(server.url, "task", "show", word).stderr
        assert server.received == []
    for word in ("x?limit=1", "%2e%2e", "x#y"):
        assert "task: String should match" in run_cli(url, "task", "show", word).stderr
