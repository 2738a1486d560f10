"""The README's commands and its program run unchanged."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
README = (HERE.parent / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(bash|python)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def run(folder: Path, *words: str) -> str:
    """What a program prints that must end well; Inspect reaches no network."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    own = {**os.environ, "PATH": path, "PYTHONPATH": str(HERE / "offline"), "TERM": "dumb"}
    kept = {"capture_output": True, "text": True, "timeout": 200}
    done = subprocess.run(words, cwd=folder, env=own, check=False, **kept)
    assert done.returncode == 0, (words, done.stdout[-3000:], done.stderr[-3000:])
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("readme")


@pytest.mark.nightly
def test_commands_and_program_in_the_order_of_the_page(folder) -> None:
    assert [kind for kind, _ in BLOCKS] == ["bash", "bash", "bash", "python"]
    outputs = []
    for kind, text in BLOCKS:
        if kind == "bash":
            outputs.append(run(folder, "bash", "-ec", text))
        else:
            (folder / "script.py").write_text(text)
            outputs.append(run(folder, sys.executable, "script.py"))
    assert len(list((folder / "logs").glob("*.eval"))) == 4
    for shown in outputs[:3]:
        assert "accuracy" in shown
        assert "errors and were not scored" not in shown
    assert outputs[3].startswith("there is no machine to simulate")
