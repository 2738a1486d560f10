"""What a site is refused for, and which jobs it keeps whole."""

import fcntl
from pathlib import Path

import pytest
from support.clients.commands import run
from tests.cli.test_site import files_of, idle, pages  # noqa: F401 - fixtures

from buildarena_cli.commands import site as command
from buildarena_cli.errors import CommandError
from buildarena_cli.site import pages as site_pages
from buildarena_cli.site.asking import question
from buildarena_cli.site.folder import MARKER, Folder
from buildarena_cli.site.scope import Scope, chosen_jobs, read_choice


@pytest.fixture
def refused(url, idle, tmp_path):  # noqa: F811 - a fixture
    """Runs the command, and gives the words that it is refused with."""

    def work(*words: str, out: Path = tmp_path / "site", sweep: str = idle) -> str:
        done = run("site", *([sweep] if sweep else []), "--out", str(out), *words, "--url", url)
        assert done.returncode != 0, done.stdout
        assert not (out / "index.html").exists()
        return done.stderr

    return work


def test_a_folder_of_something_else_is_left_alone(refused, tmp_path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    for n in range(5):
        (home / f"thesis-{n}.tex").touch()
    assert "thesis-0.tex, thesis-1.tex, thesis-2.tex …" in refused(out=home)
    assert len(files_of(home)) == 5
    file = tmp_path / "file"
    file.touch()
    assert "is a file" in refused(out=file)
    newer = tmp_path / "newer"
    newer.mkdir()
    (newer / MARKER).write_text("99")
    assert "another version" in refused(out=newer)
    assert files_of(newer) == {MARKER}


def test_names_that_nothing_has_are_refused_with_the_choices(refused) -> None:
    assert "choose from five-role+data-sheets/mujoco" in refused("--track", "nobody/plays")
    assert "all, best, none or a number" in refused("--jobs", "worst")
    assert "--jobs: '-1'" in refused("--jobs=-1")
    assert "--track" in refused(sweep="")
    assert "no sweep's id begins" in refused(sweep="sweep_00000000")


@pytest.mark.ci
def test_a_large_site_is_not_written_unasked(refused, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(command, "LARGE_MB", 0)
    assert "--yes writes it all the same" in refused()
    assert not (tmp_path / "site").exists()
    with pytest.raises(AssertionError):
        refused("--yes")
    assert (tmp_path / "site" / "index.html").exists()


@pytest.mark.ci
def test_two_do_not_write_one_folder(refused, tmp_path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    with (site / MARKER).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "another process is writing" in refused()


def test_pages_that_were_not_built_are_told(refused, monkeypatch) -> None:
    monkeypatch.undo()
    monkeypatch.setattr(site_pages, "INDEX", "no-such-page.html")
    assert "`make web` builds them" in refused()


def test_a_page_of_another_version_is_no_first_page(tmp_path) -> None:
    for text in ("<html><head></head></html>", '<head><meta charset="utf-8" /></head>', ""):
        (tmp_path / "index.html").write_text(text)
        with pytest.raises(CommandError, match="another version"):
            site_pages.first_page(tmp_path)


def test_equal_contents_are_one_file(tmp_path) -> None:
    folder = Folder(tmp_path / "site")
    assert folder.keep(b"x", "json") == folder.keep(b"x", "json")
    assert folder.job_answers("job_none", "d") is None


def test_questions_have_one_spelling(subtests) -> None:
    for params, key in [
        ({}, "/p"),
        ({"b": 2, "a": "x y&z"}, "/p?a=x y&z&b=2"),
        ({"task": ["b", "a"], "none": None}, "/p?task=a&task=b"),
        ({"track": "five-role/mujoco-3"}, "/p?track=five-role/mujoco-3"),
    ]:
        with subtests.test(params=params):
            assert question("/p", params) == key


def row(id_: str, **change: object) -> dict[str, object]:
    usual = {
        **dict.fromkeys(("task", "task_version", "configuration", "track"), "x"),
        "state": "done",
        "success": True,
        "indicator": 1.0,
        "seed": 0,
        "flags": [],
    }
    return {"id": id_, **usual, **change}


def kept(choice: str, *rows: dict[str, object], disqualifying: str = "cheat") -> list[str]:
    scope = Scope(
        sweeps=[],
        track="k",
        tracks=["k"],
        jobs=rows,
        disqualifying=frozenset({disqualifying}),
    )
    return [str(job["id"]) for job in chosen_jobs(scope, read_choice(choice))]


def test_the_best_of_a_cell_are_kept() -> None:
    rows = [
        row("failed", success=False, indicator=9.0),
        row("flagged", indicator=8.0, flags=["cheat"]),
        row("noted", indicator=7.0, flags=["never_fell"]),
        row("later", indicator=7.0, seed=3),
        row("unscored", success=None, indicator=None, flags=None),
        row("open", state="running"),
        row("elsewhere", configuration="d", indicator=0.0),
    ]
    assert kept("best", *rows) == ["noted", "elsewhere"]
    assert kept("2", *rows) == ["noted", "later", "elsewhere"]
    assert kept("4", *rows) == ["noted", "later", "failed", "flagged", "elsewhere"]
    assert kept("none", *rows) == kept("0", *rows) == []
    assert kept("all", *rows) == [str(job["id"]) for job in rows if job["state"] == "done"]
    assert set(kept("100", *rows)) == set(kept("all", *rows))
