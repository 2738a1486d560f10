"""The README does what it says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from documented import run_document

README = Path(__file__).parents[2] / "libs/environment/README.md"


def test_the_readme_runs_word_for_word(tmp_path) -> None:
    assert run_document(README, environment=os.environ, folder=tmp_path) == 2


def test_a_wrong_readme_fails(tmp_path) -> None:
    wrong = tmp_path / "README.md"
    wrong.write_text(README.read_text().replace("True 0.0 Attached", "True 1.0 Attached"))
    with pytest.raises(AssertionError, match="prints"):
        run_document(wrong, environment=os.environ, folder=tmp_path)
