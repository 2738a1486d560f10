"""The README does what it says, against an endpoint on loopback."""

import os
import sys
from pathlib import Path

import pytest
from conftest import SUBMIT
from stand_in import serving
from support.documents.code_blocks import run_document
from test_rollouts import several

README = Path(__file__).parents[1] / "README.md"


@pytest.fixture
def ran(scripts, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def run(document: Path) -> int:
        with serving({"support-1": [several([*scripts["support-1"], SUBMIT])]}) as stand_in:
            environment = {**os.environ, "MODEL_URL": stand_in.url, "MODEL": "stand-in"}
            environment["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
            environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
            return run_document(document, environment=environment, folder=tmp_path)

    return run


@pytest.mark.nightly
def test_the_readme_runs_word_for_word(ran) -> None:
    assert ran(README) == 3
