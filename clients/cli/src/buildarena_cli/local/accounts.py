"""The account of a server that refuses to run as root, and which folders it can use."""

from __future__ import annotations

import os
import pwd
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from buildarena_backend.errors import StartupError

UNPRIVILEGED = "nobody"
LONGEST_PATH = 900
"""Postgres cuts paths at 1,024 bytes; what it adds to those of its folders is below 100."""
READ_BY_SHELLS = frozenset('$`"\\')
"""initdb starts its server by a shell, with the path between double quotes."""


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


class RunAs(TypedDict, total=False):
    """See `run_as`."""

    user: int
    group: int
    extra_groups: list[int]


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


def run_as(account: Account | None) -> RunAs:
    """The arguments of `subprocess.Popen` that start a process as this account."""
    if account is None:
        return {}
    return {"user": account.uid, "group": account.gid, "extra_groups": []}


def others_can_enter(folder: Path) -> bool:
    """Whether every account can pass through all folders of a path that exists."""
    resolved = folder.resolve()
    return all(parent.stat().st_mode & 0o001 for parent in (resolved, *resolved.parents))


def usable_by_path(target: Path, account: Account | None) -> bool:
    """Whether a server can use a folder or a program by its path.

    Args:
        target: It exists.
        account: Who the server runs as; None for this process' own account.
    """
    path = str(target)
    if len(os.fsencode(path)) > LONGEST_PATH or READ_BY_SHELLS.intersection(path):
        return False
    return account is None or others_can_enter(target)
