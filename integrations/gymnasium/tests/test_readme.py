"""The README does what it says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.documents.code_blocks import run_document

README = Path(__file__).parents[1] / "README.md"


def test_the_readme_runs_word_for_word(tmp_path) -> None:
    assert run_document(README, environment=os.environ, folder=tmp_path) == 6


@pytest.mark.parametrize(
    ("word", "other", "said"),
    [
        ("A 2", "A 3", "and not\nA 3"),
        ("Support-1-v0", "Support-1-v9", "version"),
        ("True 0.7", "True 0.1", "and not\nTrue 0.1"),
    ],
)
def test_a_wrong_readme_fails(word, other, said, tmp_path) -> None:
    wrong = tmp_path / "README.md"
    wrong.write_text(README.read_text().replace(word, other))
    with pytest.raises(Exception, match=said):
        run_document(wrong, environment=os.environ, folder=tmp_path)
