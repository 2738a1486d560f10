"""`buildarena challenge`: what it prints, and how it ends."""

import json
from pathlib import Path

import pytest
from support.challenge import package_files
from typer.testing import CliRunner

from buildarena_cli.errors import CommandError
from buildarena_cli.main import app

runner = CliRunner()


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "packages" / "entry"
    folder.mkdir(parents=True)
    for name, content in package_files("three_blocks").items():
        (folder / name).write_bytes(content)
    return folder


def run(*words: object) -> tuple[int, str]:
    result = runner.invoke(app, ["challenge", *map(str, words)])
    if isinstance(result.exception, CommandError):
        return result.exception.code, str(result.exception)
    return result.exit_code, result.stdout


def test_a_sound_package_passes_and_says_what_is_not_known(package: Path) -> None:
    code, text = run("check", package)
    assert code == 0
    assert "the 3 actions build the 3 blocks" in text
    assert "not published, to be given with --set: omega_ref" in text


def test_a_broken_rule_ends_with_one(package: Path) -> None:
    (package / "notes.txt").write_text("mine")
    code, text = run("check", package, "--json")
    assert code == 1
    report = json.loads(text)
    assert not report["passed"]
    failed = [each["check"] for each in report["findings"] if not each["passed"]]
    assert failed == ["files"]


def test_parameters_complete_a_score(package: Path) -> None:
    code, text = run("check", package, "--set", "center=0,-400,0", "--set", "omega_ref=0.3")
    assert code == 0
    assert "3.201 cycles of 3" in text
    for wrong, words in (
        ("omega=1", "is no parameter"),
        ("omega_ref", "expected NAME=VALUE"),
        ("omega_ref=fast", "expected a number"),
        ("center=1,2", "center"),
        ("omega_ref=nan", "omega_ref"),
    ):
        code, text = run("check", package, "--set", wrong)
        assert code == 1
        assert words in text


def test_unknown_names_have_choices(package: Path) -> None:
    assert "s01-stable-orbit" in run("check", package, "--season", "s02")[1]
    assert "there is autopilot, copilot, human" in run("check", package, "--track", "robots")[1]
    assert "No such file" in run("check", package / "nothing")[1]


def test_a_folder_of_packages_is_a_table(package: Path) -> None:
    code, text = run("table", package.parent, "--json")
    assert code == 0
    assert [(entry["name"], entry["rank"]) for entry in json.loads(text)] == [("entry", 1)]
    code, text = run("table", package.parent)
    assert "entry" in text
    assert run("table", package / "nothing")[0] == 2


def test_seasons_are_listed_and_shown() -> None:
    assert "s01-stable-orbit" in run("list")[1]
    shown = json.loads(run("show", "s01-stable-orbit", "--json")[1])
    assert shown["score"]["progress"] == 0.7
    assert "omega_ref" in shown["unknown"]
