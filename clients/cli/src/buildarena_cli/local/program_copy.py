"""A copy of the Postgres program, used if its folder can't be reached by its path."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pwd
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from buildarena_backend.errors import StartupError

UNPRIVILEGED = "nobody"
LONGEST_PATH = 900
"""Postgres cuts paths at 1,024 bytes; what it adds to those of its folders is below 100."""
READ_BY_SHELLS = frozenset('$`"\\')
"""initdb starts its server by a shell, with the path between double quotes."""


def unprivileged_account() -> pwd.struct_passwd | None:
    """Return the server's account; None if this process is not root and its own is used.

    Raises:
        StartupError: This process is root and the system does not have the account.
    """
    if os.geteuid() != 0:
        return None
    try:
        return pwd.getpwnam(UNPRIVILEGED)
    except KeyError as error:
        raise StartupError(
            f"Postgres can't run as root and the user {UNPRIVILEGED!r} is missing: run BuildArena "
            "as an ordinary user, or set BUILDARENA_DATABASE_URL"
        ) from error


def run_as(account: pwd.struct_passwd | None) -> dict[str, Any]:
    """Return the arguments of `subprocess.Popen` that start a process as this account."""
    if account is None:
        return {}
    return {"user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}


def other_users_can_enter(folder: Path) -> bool:
    """Return whether every account can pass through all folders of a path that exists."""
    resolved = folder.resolve()
    return all(parent.stat().st_mode & 0o001 for parent in (resolved, *resolved.parents))


def usable_by_path(target: Path, account: pwd.struct_passwd | None) -> bool:
    """Return whether a server can use a folder or a program by its path.

    Args:
        target: An existing folder or program.
        account: Account of the server; None for this process' own account.
    """
    path = str(target)
    if len(os.fsencode(path)) > LONGEST_PATH or READ_BY_SHELLS.intersection(path):
        return False
    return account is None or other_users_can_enter(target)


PREFIX = "buildarena-program-"
PLACES = ("/var/tmp", "/tmp", "/var/cache", "/var/lib", "/run", "/dev/shm")  # noqa: S108 - a new private folder is created in it
UNUSED = shutil.ignore_patterns("__pycache__", "include", "*.a")
LEFT_AFTER_S = 60.0
"""Age from which an unlocked copy belongs to a killed process."""


class ProgramCopy:
    """A copy of a program that every account can run, until `remove`.

    Each run has its own copy, so that none is shared, incomplete or outdated. Copies of killed
    processes are removed by the next process that creates one.

    Args:
        install: Folder of the program, ``bin/postgres`` and what belongs to it, in its package.
        account: Account that runs the program; None for this process' own account.
        places: Folders to try, in order, after the system's temporary folder.

    Attributes:
        install: Folder of the program in the copy.

    Raises:
        StartupError: The program can't be run from any of the places.
    """

    install: Path

    def __init__(
        self, install: Path, account: pwd.struct_passwd | None, places: Iterable[str] = PLACES
    ) -> None:
        refused = []
        for place in dict.fromkeys([tempfile.gettempdir(), *places]):
            try:
                self._copy_to(Path(place), install, account)
            except (OSError, subprocess.SubprocessError) as error:
                refused.append(f"{place} ({_reason(error)})")
            else:
                return
        user = "this user" if account is None else account.pw_name
        raise StartupError(
            f"Postgres, as {user}, can't be run from "
            f"{install}, nor can a copy of it from {', '.join(refused)}: run BuildArena from a "
            "folder that others can enter (chmod o+x) or as an ordinary user, or set "
            "BUILDARENA_DATABASE_URL to a Postgres server"
        )

    def remove(self) -> None:
        """Remove the copy."""
        self._folder.cleanup()
        os.close(self._lock)

    def _copy_to(self, place: Path, install: Path, account: pwd.struct_passwd | None) -> None:
        if not usable_by_path(place, account):
            raise PermissionError("Postgres can't use its path")
        if os.statvfs(place).f_flag & os.ST_NOEXEC:
            raise PermissionError("mounted noexec")
        _remove_left(place)
        folder = tempfile.TemporaryDirectory(prefix=PREFIX, dir=place, ignore_cleanup_errors=True)
        lock = os.open(folder.name, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            copy = _copied(install, Path(folder.name))
            _require_it_runs(copy, account)
        except BaseException:
            folder.cleanup()
            os.close(lock)
            raise
        self._folder, self._lock, self.install = folder, lock, copy


def _copied(install: Path, target: Path) -> Path:
    """Copy a program with its libraries, which it finds relative to itself."""
    package = install.parent
    unused = {folder.name for folder in package.glob("pginstall*")} - {install.name}
    libraries = package.with_name(f"{package.name}.libs")  # the wheel's, next to the package
    for source in (package, libraries):
        if source.exists():
            shutil.copytree(
                source,
                target / source.name,
                ignore=lambda folder, names: UNUSED(folder, names) | unused,
                copy_function=_copy_readable,
            )
    for folder, _, _ in os.walk(target):
        Path(folder).chmod(0o755)
    return target / package.name / install.name


def _copy_readable(source: str, target: str) -> str:
    """Copy a file, readable for all even under a strict umask."""
    shutil.copyfile(source, target)
    Path(target).chmod(0o755 if os.access(source, os.X_OK) else 0o644)
    return target


def _require_it_runs(install: Path, account: pwd.struct_passwd | None) -> None:
    subprocess.run(
        [install / "bin" / "postgres", "--version"],
        check=True,
        capture_output=True,
        timeout=30,
        cwd="/",
        env={},
        **run_as(account),
    )


def _remove_left(place: Path) -> None:
    for left in place.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):
            status = left.lstat()
            if status.st_uid != os.geteuid() or time.time() - status.st_mtime < LEFT_AFTER_S:
                continue
            lock = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left, ignore_errors=True)
            finally:
                os.close(lock)


def _reason(error: Exception) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        lines = error.stderr.decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {error.returncode}"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error)
