"""Ids: a unique prefix is enough, nonsense never becomes part of a path, files come whole."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.clients.commands import printed, run_cli
from support.clients.terminals import piped
from support.jobs import attach, claim, finish

from buildarena_cli.commands.job_files import file_name
from buildarena_cli.suggestions import suggested_words
from buildarena_pipeline.catalog.specs import SweepSpec

JSON = "application/json"


@pytest.fixture
def sweep(submissions) -> str:
    spec = SweepSpec(
        tasks=["support-1", "lift-1"], models=["builtin/idle", "builtin/random"], samples=8
    )
    return str(submissions.submit_sweep(spec).sweep.id)


@pytest.fixture
def ids(sweep, context) -> list[str]:
    assert sweep
    return sorted(job.id for job in context.store.jobs.page(limit=100))


def unique_prefix(ids: list[str], wanted: str) -> str:
    others = [id_ for id_ in ids if id_ != wanted]
    return next(
        wanted[:n] for n in range(5, 25) if not any(o.startswith(wanted[:n]) for o in others)
    )


def test_a_unique_prefix_is_enough_with_and_without_its_kind(url, ids, sweep) -> None:
    for wanted in (ids[0], ids[-1]):
        prefix = unique_prefix(ids, wanted)
        for word in (prefix, prefix.removeprefix("job_")):
            assert json.loads(printed(url, "job", "show", word, "--json"))["id"] == wanted
    assert json.loads(printed(url, "sweep", "status", sweep[:9], "--json"))["id"] == sweep
    assert json.loads(printed(url, "job", "list", "--sweep", sweep[6:10], "--json"))["jobs"]


def test_an_ambiguous_prefix_is_refused_with_the_candidates(url, ids) -> None:
    doubled = next(p for p in "0123456789abcdef" if sum(i[4] == p for i in ids) > 1)
    candidates = [id_ for id_ in ids if id_[4] == doubled]
    done = run_cli(url, "job", "cancel", doubled)
    assert done.returncode == 1
    assert all(id_ in done.stderr for id_ in candidates)
    assert not any(id_ in done.stderr for id_ in ids if id_ not in candidates)
    missing = next(
        f"{a}{b}" for a in "0f" for b in "0123456789abcdef" if not any(i[4:6] == a + b for i in ids)
    )
    assert f"no job's id begins with 'job_{missing}'" in run_cli(url, "job", "show", missing).stderr


def test_nonsense_is_no_id_and_is_never_sent(subtests) -> None:
    for word in [
        "../sweeps/x/cancel#",
        "job_",
        "",
        "job_%2e",
        "sweep_0",
        "job_0A",
        "x" * 5000,
        "job_0\n",
        "é",
        ".",
    ]:
        with subtests.test(word=word):
            for words in (["job", "cancel", word], ["job", "files", word], ["job", "logs", word]):
                done = run_cli("http://127.0.0.1:1", *words)
                assert done.returncode == 1
                assert "is not the id of a job" in done.stderr


def test_names_that_are_no_ids_reach_no_other_route(url) -> None:
    for word in ("x?limit=1", "%2e%2e", "x#y"):
        assert "name: String should match" in run_cli(url, "task", "show", word).stderr
    for word in ("..", "../jobs", "a/b", ""):
        assert f"{word!r} is not a name" in run_cli(url, "task", "show", word).stderr


PATIENT = """
import sys
from buildarena_cli.terminal import completion
from buildarena_cli.main import run
completion.WITHIN_S = 60
sys.argv = ["buildarena"]
run()
"""
"""The command, which waits for a busy machine's API; a shell's user would not."""


def test_shells_are_offered_ids_tasks_and_models(url, ids, sweep) -> None:
    def offered(line: str) -> list[str]:
        completing = {
            "_BUILDARENA_COMPLETE": "complete_bash",
            "COMP_WORDS": line,
            "COMP_CWORD": str(line.count(" ")),
            "BUILDARENA_URL": url,
        }
        done = subprocess.run(
            [sys.executable, "-c", PATIENT],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | completing,
        )
        assert done.stderr == ""
        return done.stdout.split()

    assert sorted(offered("buildarena job show ")) == ids
    assert offered(f"buildarena job show {ids[3]}") == [ids[3]]
    assert offered("buildarena sweep watch sw") == [sweep]
    assert offered("buildarena job list --task lift-") == ["lift-1", "lift-2", "lift-3", "lift-4"]
    assert offered("buildarena job list --model builtin/e") == ["builtin/expert"]
    assert offered("buildarena job show nothing") == []


def test_shells_are_offered_nothing_when_no_api_answers(subtests) -> None:
    for url in ["http://127.0.0.1:1", "nonsense", "http://[", "ftp://x:99999"]:
        with subtests.test(url=url):
            done = piped(
                _BUILDARENA_COMPLETE="complete_bash",
                COMP_WORDS="buildarena job show ",
                COMP_CWORD="3",
                BUILDARENA_URL=url,
            )
            assert (done.stdout.strip(), done.stderr) == ("", "")


def test_jobs_are_filtered_by_how_they_ended(url, ids, context) -> None:
    lease = claim(context)
    found = finish(context, lease, "unsuccessful", reason="too_weak", flags=("unstable", "odd"))
    for words in (
        ["--reason", "too_weak"],
        ["--flag", "odd"],
        ["--flag", "unstable", "--outcome", "unsuccessful"],
        ["--state", "done", "--task", lease.job.task, "--model", lease.job.model],
    ):
        _, row = printed(url, "job", "list", *words).splitlines()
        assert row.split()[0] == found
    assert printed(url, "job", "list", "--outcome", "success").count("\n") == 1
    assert printed(url, "job", "list", "--task", "lift-3").count("\n") == 1
    assert len(ids) == 32


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--task", "lift-9"], "there is no task 'lift-9'"),
        (["--task", "lift-9"], "did you mean lift-1 or"),
        (["--model", "builtin/idel"], "did you mean builtin/idle?"),
        (["--outcome", "sucess"], "did you mean success"),
        (["--state", "runing"], "did you mean running"),
        (["--after", "x"], "not a cursor"),
    ],
)
def test_a_filter_that_fits_nothing_is_refused_with_the_choices(url, sweep, words, says) -> None:
    done = run_cli(url, "job", "list", *words)
    assert (done.returncode, says in done.stderr) == (1, True), done.stderr
    assert sweep


def test_pages_follow_each_other(url, ids) -> None:
    first = run_cli(url, "job", "list", "--limit", "20")
    rows = first.stdout.splitlines()[1:]
    cursor = first.stderr.split("--after ")[1].split(",")[0]
    second = run_cli(url, "job", "list", "--limit", "20", "--after", cursor)
    rows += second.stdout.splitlines()[1:]
    assert (sorted(row.split()[0] for row in rows), second.stderr) == (ids, "")
    assert len(printed(url, "job", "list", "--limit", "3", "--all").splitlines()) == 33


@pytest.fixture
def made(context, sweep) -> tuple[str, dict[str, bytes]]:
    """A job with three files."""
    assert sweep
    lease = claim(context)
    files = {"machine": b"{}", "transcript": b"[]", "trajectory-0": b"PAR1"}
    attach(context, lease.job.id, files, JSON)
    return finish(context, lease, "unsuccessful"), files


def test_a_jobs_files_are_listed_and_fetched(url, made, tmp_path) -> None:
    job, files = made
    head, *rows = printed(url, "job", "files", job).splitlines()
    assert head.split() == ["file", "type", "bytes", "sha256"]
    assert [row.split()[0] for row in rows] == sorted(files)
    assert all(len(row.split()[-1]) == 64 for row in rows)
    out = tmp_path / "some" / "folder"
    printed(url, "job", "files", job, "--out", str(out))
    assert {f.name: f.read_bytes() for f in out.iterdir()} == {
        f"{name}.json": data for name, data in files.items()
    }
    printed(url, "job", "files", job, "machine", "--out", str(tmp_path / "one"))
    assert [f.name for f in (tmp_path / "one").iterdir()] == ["machine.json"]
    assert "did you mean machine?" in run_cli(url, "job", "files", job, "machin").stderr


def test_damaged_bytes_are_not_written(url, made, tmp_path, monkeypatch) -> None:
    from buildarena_cli.client import Client

    monkeypatch.setattr(Client, "get_bytes", lambda *_, **__: b"other")
    done = run_cli(url, "job", "files", made[0], "--out", str(tmp_path / "out"))
    assert (done.returncode, "arrived damaged" in done.stderr) == (1, True)
    assert not (tmp_path / "out").exists()


def test_a_files_name_stays_in_its_folder(subtests) -> None:
    for name, safe in [
        ("machine", "machine.json"),
        ("../../etc/passwd", "_.._etc_passwd.json"),
        (".hidden", "hidden.json"),
        ("a/b\\c:d\x00", "a_b_c_d_.json"),
        ("...", "file.json"),
        ("x.json", "x.json"),
    ]:
        with subtests.test(name=name):
            assert file_name(name, JSON) == safe
            assert Path(safe).name == safe


def test_near_words(subtests) -> None:
    for word, near in [
        ("seed", ["seeds"]),
        ("expert", ["builtin/expert"]),
        ("Lift-1", ["lift-1"]),
        ("zzz", []),
        ("", []),
    ]:
        with subtests.test(word=word):
            assert suggested_words(word, ["seeds", "samples", "builtin/expert", "lift-1"]) == near
