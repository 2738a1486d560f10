"""Plays one short trial in the game, prints its score; a program, so that it can be killed."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from game_rig import Rig, experts_machine, shortened, trial_of

from buildarena_benchmark import score
from buildarena_simworker.simulators.besiege.set_up import make_desktop
from buildarena_simworker.simulators.besiege.settings import BesiegeSettings
from buildarena_simworker.simulators.besiege.simulator import BesiegeSimulator


def main() -> None:
    """Plays the car for a few seconds in the folder that is named."""
    rig = Rig(folder=Path(sys.argv[1]))
    for name, value in rig.environment().items():
        os.environ.setdefault(name, value)
    settings = BesiegeSettings()
    desktop, facts = make_desktop(settings)
    task, machine = shortened("transport-1", 5.0), experts_machine("transport-1")
    done = BesiegeSimulator(settings, desktop, facts).run(
        trial_of(task, machine, job_id="job_killed")
    )
    found = score(task, machine, done.trajectory)
    sys.stdout.write(json.dumps([found.success, found.indicator]) + "\n")


main()
