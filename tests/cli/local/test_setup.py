"""Set-up with a uv that only notes what it is asked and fails as wished."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.programs import captured

SCRIPTS = Path(__file__).parents[3] / "mk"
PYBULLET = """\
pybullet==3.2.7 ; a \\
    --hash=b \\
    --hash=c
    # via buildarena-a (libs/a/pyproject.toml)
"""
NUMPY = "numpy==2.0 \\\n    --hash=a\n    # via pybullet, scipy\n"
SCIPY = "scipy==1.0\n    # via -r requirements-dev.in\n"
OF_OTHERS = "ribs==1.0\n    # via -r requirements-tools.in\n"
LOCK = f"# Its head.\n{NUMPY}{PYBULLET}{OF_OTHERS}{SCIPY}"
UV = """#!/bin/sh
echo "$@" >> calls
case "$*" in
{answers}
"python find"*) exit 1;;
"venv"*) mkdir -p .venv/bin; ln -sf {python} .venv/bin/python;;
esac
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "requirements.lock").write_text(LOCK)
    (tmp_path / "libs/a").mkdir(parents=True)
    (tmp_path / "libs/a/pyproject.toml").write_text('[project]\nname = "buildarena-a"\n')
    (tmp_path / "bin").mkdir()
    for name in ("sh", "bash", "awk", "dirname", "mkdir", "ln", "cat", "cp", "mktemp", "rm"):
        (tmp_path / "bin" / name).symlink_to(shutil.which(name))
    program(tmp_path / "bin" / "python3", f'exec {shlex.quote(sys.executable)} "$@"')
    return tmp_path


def program(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def set_up(folder: Path, *answers: str, **environment: str) -> subprocess.CompletedProcess[str]:
    uv = folder / "bin" / "uv"
    uv.write_text(UV.format(answers="\n".join(answers), python=shlex.quote(sys.executable)))
    uv.chmod(0o755)
    return run(folder, "install.sh", ".venv", "libs/a", **environment)


def run(folder: Path, script: str, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(folder / "bin"), "TMPDIR": os.environ.get("TMPDIR", "/tmp"), **more}
    command = ["/bin/bash", str(SCRIPTS / script), *words]
    return captured(command, cwd=folder, env=environment)


def calls(folder: Path) -> list[str]:
    return (folder / "calls").read_text().splitlines()


def test_set_up_says_nothing_where_everything_has_a_wheel(folder) -> None:
    done = set_up(folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    (sync,) = [call for call in calls(folder) if "sync" in call]
    assert sync.endswith(
        "--only-binary pybullet --only-binary pybullet-arm64 .venv/requirements.lock"
    )
    assert (folder / ".venv/requirements.lock").read_text() == NUMPY + PYBULLET + SCIPY
    assert calls(folder)[-1].endswith("--no-deps --no-build-isolation -e libs/a")


NO_WHEEL = '*"--only-binary"*) echo no wheel >&2; exit 1;;'
NO_COMPILING = '*"sync"*"requirements.lock") echo cc1plus is missing >&2; exit 1;;'


def test_what_pybullet_cannot_be_installed_for_is_said_and_the_rest_is_installed(folder) -> None:
    done = set_up(folder, NO_WHEEL, NO_COMPILING)
    assert (done.returncode, done.stderr) == (0, "")
    assert "there is no C++ compiler: without it, name MuJoCo" in done.stdout
    assert (folder / ".venv/without-pybullet.lock").read_text() == NUMPY + SCIPY
    program(folder / "bin" / "c++", "exit 1")
    done = set_up(folder, NO_WHEEL, NO_COMPILING)
    assert (done.returncode, done.stderr) == (0, "")
    assert "could not be compiled (see .venv/pybullet.log)" in done.stdout
    assert "cc1plus is missing" in (folder / ".venv/pybullet.log").read_text()
    done = set_up(folder, '*"sync"*) echo no index >&2; exit 1;;')  # of other packages
    assert (done.returncode != 0, done.stderr, done.stdout) == (True, "no index\n", "")


def test_a_given_python_is_used_unless_it_is_too_old(folder) -> None:
    assert set_up(folder, PYTHON=sys.executable).returncode == 0
    assert not [call for call in calls(folder) if "python find" in call]
    program(folder / "old", "exit 1")
    done = set_up(folder, PYTHON="./old")
    assert done.returncode == 1
    assert "needs Python 3.11 or newer, and ./old is older or missing" in done.stderr
