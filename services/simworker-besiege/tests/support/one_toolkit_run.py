"""Plays one short trial by the toolkit and prints its indicator; a program that can be killed."""

import json
import sys

import structlog
from game_rig import short_trial, trial_of

from buildarena_benchmark import score
from buildarena_simworker_besiege.settings import BesiegeSettings
from buildarena_simworker_besiege.toolkit.simulator import ToolkitSimulator


def main() -> None:
    """Plays the car for a few seconds, as the environment says."""
    structlog.configure(logger_factory=structlog.PrintLoggerFactory(sys.stderr))
    task, machine = short_trial("transport-1")
    done = ToolkitSimulator(BesiegeSettings()).run(trial_of(task, machine))
    sys.stdout.write(json.dumps(score(task, machine, done.trajectory).indicator))


main()
