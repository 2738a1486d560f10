"""The same input gives the same bytes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import hashlib, sys
from buildarena_benchmark import builtin_tasks
from buildarena_simulation import simulate, write_trajectory
from support.machines.references import load_machine
task = builtin_tasks()[sys.argv[3]]
scenario = task.scenario.model_copy(update={"duration_s": 2.6})
data = write_trajectory(simulate(load_machine(sys.argv[2]), scenario, sys.argv[1]))
print(hashlib.sha256(data).hexdigest())
"""
TESTS = Path(__file__).parents[1]


def _hash_in_new_process(engine: str, name: str, task: str, hash_seed: str) -> str:
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(TESTS)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, engine, name, task],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return done.stdout


@pytest.mark.ci
@pytest.mark.parametrize(("name", "task"), [("beam", "support-1"), ("carrier", "transport-2")])
def test_two_processes_give_the_same_bytes(engine, name, task) -> None:
    first, second = (_hash_in_new_process(engine, name, task, seed) for seed in ("1", "2"))
    assert first == second
    assert len(first.strip()) == 64
