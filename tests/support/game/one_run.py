"""Plays one short trial in the game, prints its score or fault; a program that can be killed."""

import json
import os
import sys
from pathlib import Path

import structlog
from support.game.game_rig import Rig, short_trial, trial_of

from buildarena_backend.trials.simulator import SimulatorFaultError
from buildarena_benchmark import score
from buildarena_simworker.besiege.screen.window import make_desktop
from buildarena_simworker.besiege.settings import BesiegeSettings
from buildarena_simworker.besiege.simulator import BesiegeSimulator


def main() -> None:
    """Plays the car, or another short trial, for a few seconds in the folder that is named."""
    # What the runner had to do again goes to its log: standard output is the score's.
    structlog.configure(logger_factory=structlog.PrintLoggerFactory(sys.stderr))
    rig = Rig(folder=Path(sys.argv[1]))
    for name, value in rig.environment().items():
        os.environ.setdefault(name, value)
    settings = BesiegeSettings()
    desktop, facts = make_desktop(settings)
    task, machine = short_trial(sys.argv[2] if len(sys.argv) > 2 else "transport-1")
    try:
        trial = trial_of(task, machine, job_id="job_killed")
        done = BesiegeSimulator(settings, desktop, facts).run(trial)
    except SimulatorFaultError as fault:
        told = {"fault": str(fault), "pictures": len(fault.files), "endless": fault.endless}
        sys.stdout.write(json.dumps(told) + "\n")
        return
    found = score(task, machine, done.trajectory)
    sys.stdout.write(json.dumps([found.success, found.indicator]) + "\n")


main()
