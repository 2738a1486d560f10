"""What the distribution's README says happens, word for word."""

import doctest
import re
from pathlib import Path

import pytest
from support.clients.commands import run

pytestmark = pytest.mark.ci

ROOT = Path(__file__).parents[2]
README = ROOT / "clients" / "buildarena" / "README.md"
PAGE = ROOT / "docs" / "notebooks.md"


def failures(text: str) -> int:
    """How many of a text's examples do something else than it says."""
    test = doctest.DocTestParser().get_doctest(text, {}, README.name, str(README), 0)
    assert len(test.examples) > 5
    return doctest.DocTestRunner(verbose=False).run(test).failed


def test_the_page_of_the_documentation_runs_as_it_stands():
    assert failures(PAGE.read_text(encoding="utf-8")) == 0


def test_its_python_runs_as_it_stands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert failures(README.read_text(encoding="utf-8")) == 0
    assert (tmp_path / "bridge.html").stat().st_size > 1000


def test_it_can_fail(tmp_path, monkeypatch, capsys, subtests):
    for change in [("load 959.81", "load 959.82"), ("Refused (", "Accepted ("), ('"F")', '"A")')]:
        with subtests.test(change=change):
            monkeypatch.chdir(tmp_path)
            text = README.read_text(encoding="utf-8")
            assert change[0] in text
            assert failures(text.replace(*change)) > 0
            assert "Expected:" in capsys.readouterr().out


def test_its_commands_exist():
    # `tests/e2e/test_release.py` installs the wheels, and has them run the demo.
    named = re.findall(r"^buildarena (\w+)", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert named == ["demo", "up"]
    for name in named:
        assert run(name, "--help").returncode == 0
