"""The table by which commands are found; their modules are in `buildarena_cli.commands`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Entry:
    """Where a command is.

    Attributes:
        module: The module of `buildarena_cli.commands` that has it.
        attribute: The function, or the group, in that module.
        help: The first sentence of its help; a test compares them.
    """

    module: str
    attribute: str
    help: str


COMMANDS: Final[Mapping[str, Entry]] = {
    "demo": Entry(
        "service", "demo", "Start everything, run one small sweep, show who builds best, and stop."
    ),
    "up": Entry("service", "up", "Start the whole service on this machine."),
    "down": Entry("running", "down", "Stop the service that runs on the data folder."),
    "status": Entry("running", "status", "Show which parts of the service run on the data folder."),
    "logs": Entry("running", "logs", "Print the logs of the service's processes."),
    "doctor": Entry("running", "doctor", "Show what is wrong with the service and what to do."),
    "sweep": Entry("sweeps", "app", "Submit and watch sweeps."),
    "job": Entry("jobs", "app", "Submit and look at jobs."),
    "leaderboard": Entry("leaderboard", "leaderboard", "Show who builds best on each track."),
    "compare": Entry("leaderboard", "compare", "Show whether one model is better than another."),
    "report": Entry("report", "report", "Write a report of sweeps: tables and plots."),
    "site": Entry(
        "site", "site", "Write a board as a static site, which any file server can show."
    ),
    "export": Entry("exports", "export", "Write the leaderboard to a file, or jobs as a dataset."),
    "audit": Entry("leaderboard", "audit", "Replay and simulate a model's results again."),
    "dataset": Entry("datasets", "app", "Make and verify datasets of machines, without a service."),
    "task": Entry("tasks", "app", "Look at tasks, and add your own."),
    "model": Entry("models", "app", "Look at models."),
    "machine": Entry("machine", "app", "Simulate and draw machines on this computer."),
    "besiege": Entry("besiege", "app", "Play machines in the game Besiege."),
    "challenge": Entry("challenge", "app", "Check what is handed in to a challenge."),
    "key": Entry("keys", "app", "Make, list, rotate, revoke and reinstate API keys."),
    "mcp": Entry("mcp", "mcp", "Let agents that speak the Model Context Protocol build."),
    "worker": Entry("worker", "app", "Run workers by themselves."),
    "backup": Entry("backups", "backup", "Back up the database and its artifacts."),
    "restore": Entry("backups", "restore", "Restore a backup into an empty database."),
    "artifacts": Entry("artifacts", "app", "Look after the store of artifacts."),
    "history": Entry("histories", "app", "Pack what old jobs left in the database."),
    "migrate": Entry("worker", "migrate", "Bring the database to this program's schema."),
    "roles": Entry("worker", "roles", "Make the logins of a service's processes."),
}
