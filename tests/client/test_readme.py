"""The README's programs, word for word, against a real service that works."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "clients" / "python" / "README.md"
PROGRAMS = re.findall(r"^```python\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
SAYS = ("lift-1 builtin/expert 1.0", "transcripts", "success_low", "construction_failed", "model")


@pytest.fixture(scope="module")
def busy(service):
    """The service while it works."""
    with service.working():
        yield service


def ran(program: str, url: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env={**os.environ, "BUILDARENA_URL": url},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("program", "says"), list(zip(PROGRAMS, SAYS, strict=True)), ids=SAYS)
def test_a_program_does_what_it_says(busy, program, says) -> None:
    done = ran(program, busy.url)
    assert (done.returncode, done.stderr) == (0, "")
    assert says in done.stdout


def test_a_program_that_is_wrong_fails(busy) -> None:
    assert ran(PROGRAMS[0].replace("submit_sweep", "submit_sweeps"), busy.url).returncode != 0
    assert "not to be had now" in ran(PROGRAMS[-1], "http://127.0.0.1:1").stdout


def test_methods_that_are_named_exist() -> None:
    import buildarena_client

    text = README.read_text()
    known = {*dir(buildarena_client), *dir(buildarena_client.Client)}
    named = re.findall(r"`([a-z]+_[a-z_]+|[A-Z][A-Za-z]+(?:Error|Client)?)(?:\(.*\))?`", text)
    fields = {"at_once", "Path"}
    assert {name for name in named if not name.isupper()} - known - fields == set()
