"""The account of a server that refuses to run as root, and which folders it can enter."""

from __future__ import annotations

import os
import pwd
from dataclasses import dataclass
from pathlib import Path

from buildarena_pipeline.errors import StartupError

UNPRIVILEGED = "nobody"


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """A system account.

    Attributes:
        name: For messages.
        uid: Its user.
        gid: Its only group.
    """

    name: str
    uid: int
    gid: int


def unprivileged_account() -> Account | None:
    """The account such a server runs as; None when this process is not root and its own will do.

    Raises:
        StartupError: This process is root and the system has no such account.
    """
    if os.geteuid() != 0:
        return None
    try:
        entry = pwd.getpwnam(UNPRIVILEGED)
    except KeyError as error:
        raise StartupError(
            f"Postgres can't run as root and there is no user {UNPRIVILEGED!r}: run BuildArena "
            "as an ordinary user, or set BUILDARENA_DATABASE_URL"
        ) from error
    return Account(name=UNPRIVILEGED, uid=entry.pw_uid, gid=entry.pw_gid)


def others_can_enter(folder: Path) -> bool:
    """Whether every account can pass through all folders of a path that exists."""
    resolved = folder.resolve()
    return all(parent.stat().st_mode & 0o001 for parent in (resolved, *resolved.parents))
