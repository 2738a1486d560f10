"""Trials give the same bytes on several kinds of processors."""

import os
import subprocess
import sys

import pytest
from support.machines.references import load_machine

from buildarena_benchmark import builtin_tasks
from buildarena_environment.other_kernels import simulate_with
from buildarena_geometry import Machine, kernels
from buildarena_simulation import (
    MachineNotSimulable,
    SimulationError,
    UnknownEngineError,
    processor,
    simulate,
    write_trajectory,
)

OTHERS = [name for name in kernels.runnable() if name != kernels.PINNED]
several = pytest.mark.skipif(not OTHERS, reason="this processor has one kind of kernels")
TRIALS = 1
TASK = builtin_tasks()["support-1"]
SCENARIO = TASK.scenario.model_copy(update={"duration_s": 2.6})


@pytest.mark.ci
@several
def test_a_trial_of_other_kernels_is_repeated_to_the_byte() -> None:
    machine = load_machine("wide-deck")
    own, *others = (
        write_trajectory(trajectory)
        for trajectory in (
            simulate(machine, SCENARIO, "mujoco"),
            simulate_with(OTHERS[0], machine, SCENARIO, "mujoco"),
            simulate_with(OTHERS[0], machine, SCENARIO, "mujoco"),
            simulate_with(kernels.PINNED, machine, SCENARIO, "mujoco"),
        )
    )
    assert others[0] == others[1], "the same kernels, the same bytes"
    assert others[0] != own, "the trial tells kernels apart"
    assert others[2] == own


def test_kernels_that_no_processor_has_are_an_error() -> None:
    with pytest.raises(SimulationError, match="no kernels Abacus"):
        simulate_with("Abacus", load_machine("beam"), SCENARIO, "mujoco")


@several
def test_a_trial_that_fails_there_says_why() -> None:
    with pytest.raises(UnknownEngineError, match="no engine 'steam'"):
        simulate_with(OTHERS[0], load_machine("beam"), SCENARIO, "steam")
    with pytest.raises(MachineNotSimulable) as here:
        simulate(Machine(), SCENARIO, "mujoco")
    with pytest.raises(MachineNotSimulable) as there:
        simulate_with(OTHERS[0], Machine(), SCENARIO, "mujoco")
    assert str(there.value) == str(here.value)


def test_the_processor_is_said_by_what_rounds() -> None:
    assert set(processor()) == {"blas", "numpy", "machine", "libm"}
    if kernels.PINNED is not None:
        assert processor()["blas"] == kernels.PINNED


@several
def test_a_program_that_loaded_numpy_first_is_warned_where_it_matters() -> None:
    program = (
        "import numpy, warnings\n"
        "from buildarena_simulation.processor import warn_if_late\n"
        "with warnings.catch_warnings(record=True) as caught:\n"
        "    warn_if_late(); warn_if_late()\n"
        "print(*(str(warning.message) for warning in caught), sep='\\n')"
    )
    for name, warned in ((OTHERS[0], True), (kernels.PINNED, False)):
        environment = {**os.environ, "OPENBLAS_CORETYPE": name}
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        assert (f"kernels {name} in place of" in done.stdout) == warned
        assert done.stdout.count("Import buildarena first") == warned
