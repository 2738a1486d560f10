"""What importing the libraries costs: no engine, no pyarrow, no scipy."""

import subprocess
import sys

import pytest

HEAVY = ("pybullet", "mujoco", "pyarrow", "scipy", "matplotlib", "PIL")


@pytest.mark.parametrize("library", ["buildarena_simulation", "buildarena_benchmark"])
def test_importing_a_library_loads_nothing_heavy(library) -> None:
    program = f"import sys, {library}; print(*sorted(set({HEAVY!r}) & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""


def test_an_engine_keeps_stdout_and_stderr_clean() -> None:
    program = (
        "from buildarena_simulation import Scenario, simulate\n"
        "from buildarena_geometry import Machine\n"
        "m = Machine(); m.act('start', {})\n"
        "for engine in ('pybullet', 'mujoco'):\n"
        "    simulate(m, Scenario(duration_s=0.2), engine)\n"
        "print('done')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("done\n", "")
