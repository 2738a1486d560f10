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


GROUPS: Final[Mapping[str, Mapping[str, Entry]]] = {
    "Start": {
        "demo": Entry(
            "service",
            "demo",
            "Start everything, run one small sweep, show who builds best, and stop.",
        ),
        "up": Entry("service", "up", "Start the whole service on this machine."),
        "down": Entry("running", "down", "Stop the service that runs on the data folder."),
        "doctor": Entry("running", "doctor", "Show what is wrong with the service and what to do."),
    },
    "Evaluate": {
        "sweep": Entry("sweeps", "app", "Submit and watch sweeps."),
        "job": Entry("jobs", "app", "Submit and look at jobs."),
    },
    "Look": {
        "leaderboard": Entry("leaderboard", "leaderboard", "Show who builds best on each track."),
        "compare": Entry(
            "leaderboard", "compare", "Show whether one model is better than another."
        ),
        "export": Entry(
            "exports", "export", "Write the leaderboard to a file, or jobs as a dataset."
        ),
        "site": Entry(
            "site", "site", "Write a board as a static site, which any file server can show."
        ),
    },
    "Extend": {
        "task": Entry("tasks", "app", "Look at tasks, and add your own."),
        "model": Entry("models", "app", "Look at models."),
        "machine": Entry("machine", "app", "Simulate and draw machines on this computer."),
        "besiege": Entry("besiege", "app", "Play machines in the game Besiege."),
        "mcp": Entry("mcp", "mcp", "Let agents that speak the Model Context Protocol build."),
    },
    "Operate": {
        "admin": Entry("admin", "app", "Keys, workers, backups and the database of a service."),
    },
}
"""The commands by what they are for."""
COMMANDS: Final[Mapping[str, Entry]] = {
    name: entry for group in GROUPS.values() for name, entry in group.items()
}
ADMIN: Final[Mapping[str, Entry]] = {
    "status": Entry("running", "status", "Show which parts of the service run on the data folder."),
    "logs": Entry("running", "logs", "Print the logs of the service's processes."),
    "key": Entry("keys", "app", "Make, list, rotate, revoke and reinstate API keys."),
    "worker": Entry("worker", "worker", "Serve a queue from this process until Ctrl-C."),
    "backup": Entry("backups", "backup", "Back up the database and its artifacts."),
    "restore": Entry("backups", "restore", "Restore a backup into an empty database."),
    "migrate": Entry("worker", "migrate", "Bring the database to this program's schema."),
    "roles": Entry("worker", "roles", "Make the logins of a service's processes."),
    "gc": Entry("artifacts", "collect", "Remove artifacts that nothing refers to."),
}
"""The commands of `admin`."""
