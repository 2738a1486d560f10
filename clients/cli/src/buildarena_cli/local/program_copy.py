"""A copy of the Postgres program, for when its folder can't be used by its path."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from buildarena_backend.errors import StartupError
from buildarena_cli.local.accounts import Account, run_as, usable_by_path

PREFIX = "buildarena-program-"
PLACES = ("/var/tmp", "/tmp", "/var/cache", "/var/lib", "/run", "/dev/shm")  # noqa: S108 - a fresh folder of our own is made there
UNUSED = shutil.ignore_patterns("__pycache__", "include", "*.a")
LEFT_AFTER_S = 60.0
"""A copy this old that nobody has locked was left by a process that was killed."""


class ProgramCopy:
    """A program that every account can run, from its making until `remove`.

    Each run has a copy of its own: none is ever shared, half made or out of date, and nothing
    stays behind. What a killed process left is removed by the next that makes a copy.

    Args:
        install: Folder of the program, ``bin/postgres`` and what belongs to it, in its package.
        account: Who shall run it; None for this process' own account.
        places: Folders to try, in this order; the system's temporary folder comes first.

    Attributes:
        install: The same folder in the copy.

    Raises:
        StartupError: It can be run from none of the places; the message has the reasons.
    """

    install: Path

    def __init__(
        self, install: Path, account: Account | None, places: Iterable[str] = PLACES
    ) -> None:
        refused = []
        for place in dict.fromkeys([tempfile.gettempdir(), *places]):
            try:
                self._copy_to(Path(place), install, account)
            except (OSError, subprocess.SubprocessError) as error:
                refused.append(f"{place} ({_reason(error)})")
            else:
                return
        raise StartupError(
            f"Postgres, as {'this user' if account is None else account.name}, can't be run from "
            f"{install}, nor can a copy of it from {', '.join(refused)}: run BuildArena from a "
            "folder that others can enter (chmod o+x) or as an ordinary user, or set "
            "BUILDARENA_DATABASE_URL to a Postgres server"
        )

    def remove(self) -> None:
        """Removes the copy."""
        self._folder.cleanup()
        os.close(self._lock)

    def _copy_to(self, place: Path, install: Path, account: Account | None) -> None:
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
    """Copies a program with its libraries, which it looks for relative to itself."""
    package = install.parent
    others = {folder.name for folder in package.glob("pginstall*")} - {install.name}
    libraries = package.with_name(f"{package.name}.libs")  # the wheel's, beside the package
    for source in (package, libraries):
        if source.exists():
            shutil.copytree(
                source,
                target / source.name,
                ignore=lambda folder, names: UNUSED(folder, names) | others,
                copy_function=_copy_readable,
            )
    for folder, _, _ in os.walk(target):
        Path(folder).chmod(0o755)
    return target / package.name / install.name


def _copy_readable(source: str, target: str) -> str:
    """Copies a file for all to read: under a strict umask the original is its owner's alone."""
    shutil.copyfile(source, target)
    Path(target).chmod(0o755 if os.access(source, os.X_OK) else 0o644)
    return target


def _require_it_runs(install: Path, account: Account | None) -> None:
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
