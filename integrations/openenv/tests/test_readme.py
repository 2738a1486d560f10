"""The README does what it says, with a server on a free port."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import psutil
import pytest
from support.documents.code_blocks import run_document

README = Path(__file__).parents[1] / "README.md"


@pytest.fixture
def ran(tmp_path, monkeypatch, port):
    port = str(port)
    monkeypatch.setenv("PORT", port)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"

    def run(document: Path) -> int:
        return run_document(
            document, environment={**os.environ, "PATH": path, "PORT": port}, folder=tmp_path
        )

    yield run
    for process in psutil.process_iter(["cmdline"]):
        told = process.info["cmdline"] or []
        if "--port" in told and port in told and any("buildarena-openenv" in word for word in told):
            process.send_signal(signal.SIGTERM)
            process.wait(20)


def test_the_readme_runs_word_for_word(ran) -> None:
    assert ran(README) == 2


@pytest.mark.nightly
def test_a_wrong_readme_fails(ran, tmp_path) -> None:
    wrong = tmp_path / "README.md"
    wrong.write_text(README.read_text().replace("True 0.0 False", "True 1.0 True"))
    with pytest.raises(AssertionError, match="and not"):
        ran(wrong)
