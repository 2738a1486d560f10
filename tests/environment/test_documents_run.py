"""What the documents of the environment show is what happens."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.documents.code_blocks import run_document, shown_in

pytestmark = pytest.mark.ci

ROOT = Path(__file__).parents[2]
README = ROOT / "libs/environment/README.md"
TRAINING = ROOT / "docs/training.md"


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("document", "blocks"), [(README, 2), (TRAINING, 3)])
def test_it_runs_word_for_word(document, blocks, tmp_path) -> None:
    assert run_document(document, environment=os.environ, folder=tmp_path) == blocks


def test_a_wrong_one_fails(tmp_path) -> None:
    wrong = tmp_path / "training.md"
    wrong.write_text(TRAINING.read_text().replace("True 99", "True 98"))
    with pytest.raises(AssertionError, match="and not\nTrue 98"):
        run_document(wrong, environment=os.environ, folder=tmp_path)
    commands = tmp_path / "commands.md"
    commands.write_text("```bash\nfalse\ntrue\n```\n")
    with pytest.raises(AssertionError):
        run_document(commands, environment=os.environ, folder=tmp_path)
    assert next(shown.output for shown in shown_in(TRAINING)) == "True 99\nFalse True\n"
