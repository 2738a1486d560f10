"""The README does what it says."""

import os
from pathlib import Path

from support.documents.code_blocks import run_document

README = Path(__file__).parents[1] / "README.md"


def test_the_readme_runs_word_for_word(tmp_path) -> None:
    assert run_document(README, environment=os.environ, folder=tmp_path) == 6
