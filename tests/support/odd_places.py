"""Runs a program from a clone at an odd place, in a mount namespace that leaves nothing behind."""

import os
import pwd
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLACE = Path("/mnt")
"""Covered by a fresh folder in memory, where each case has its clone and its data."""
ORDINARY = pwd.getpwnam("daemon").pw_uid
"""An account that every system has."""
SOURCES = ["libs/*/src", "services/*/src", "clients/cli/src", "clients/python/src", "tests"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Where a clone lies and how it is used.

    Attributes:
        folder: Of the clone and its data, below `PLACE`.
        mode: Of that folder; 0o700 is private.
        ordinary: Whether an ordinary user owns the folder and runs the program, in place of root.
        noexec: Folders that are replaced by empty ones from which nothing can be run.
        read_only: Whether the checkout can't be written.
        unset: Variables that are not set.
        before: Further commands as root, when all is mounted.
    """

    folder: str = "clone"
    mode: int = 0o700
    ordinary: bool = False
    noexec: tuple[str, ...] = ()
    read_only: bool = False
    unset: tuple[str, ...] = ()
    before: tuple[str, ...] = ()

    @property
    def place(self) -> Path:
        """The folder's path."""
        return PLACE / self.folder

    @property
    def clone(self) -> Path:
        """Where the repository is seen."""
        return self.place / "buildarena"

    @property
    def data(self) -> Path:
        """A folder for data beside the clone."""
        return self.place / "data"


def require_mounts(case: Case) -> None:
    """Skips a test where its case can't be made."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a clone at an odd place")
    if not _works("unshare", "--mount", "mount", "-t", "tmpfs", "none", str(PLACE)):
        pytest.skip("no mount namespaces here")
    if case.ordinary and not _works("setpriv", "--version"):
        pytest.skip("no setpriv here, which starts programs with fewer privileges")


def start_elsewhere(case: Case, arguments: list[str]) -> subprocess.Popen[str]:
    """Starts the clone's Python with arguments, among which {data} and {clone} are filled in."""
    require_mounts(case)
    names = {"{data}": str(case.data), "{clone}": str(case.clone)}
    filled = [names.get(word, word) for word in arguments]
    command = [str(case.clone / ".venv/bin/python"), *filled]
    if case.ordinary:
        ids = [f"--reuid={ORDINARY}", f"--regid={ORDINARY}", "--clear-groups"]
        command = ["setpriv", *ids, *command]
    environment = {"PATH": os.environ["PATH"], "HOME": str(case.place), "LANG": "C.UTF-8"}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": _import_path(case.clone)}
    for name in case.unset:
        environment.pop(name, None)
    script = "\n".join(["set -e", *_mounts(case), "exec " + shlex.join(command)])
    words = ["unshare", "--mount", "--propagation", "private", "sh", "-c", script]
    kept = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "encoding": "utf-8"}
    return subprocess.Popen(words, env=environment, cwd="/", **kept)


def run_elsewhere(case: Case, arguments: list[str]) -> str:
    """Runs the clone's Python as `start_elsewhere` does and returns what it printed."""
    with start_elsewhere(case, arguments) as process:
        printed, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return printed


def _works(*command: str) -> bool:
    try:
        return subprocess.run(command, check=False, capture_output=True).returncode == 0
    except OSError:
        return False


def _import_path(clone: Path) -> str:
    """The clone's own sources: those that were installed are the repository's at its own place."""
    found = [path.relative_to(ROOT) for pattern in SOURCES for path in ROOT.glob(pattern)]
    return ":".join(str(clone / path) for path in sorted(found))


def _mounts(case: Case) -> list[str]:
    tmpfs = "mount -t tmpfs -o mode={mode},{more} none {at}"
    clone, place = shlex.quote(str(case.clone)), shlex.quote(str(case.place))
    owned = [place, shlex.quote(str(case.data))]
    lines = [tmpfs.format(mode="755", more="exec", at=PLACE), f"mkdir -p {clone} {owned[1]}"]
    lines += [f"mount --bind {shlex.quote(str(ROOT))} {clone}"]
    if case.ordinary:
        lines += _interpreter_for_all()
        lines.append(f"chown {ORDINARY}:{ORDINARY} {' '.join(owned)}")
    lines.append(f"chmod {case.mode:o} {owned[0]}")
    if case.read_only:
        lines.append(f"mount -o remount,bind,ro {clone}")
    for folder in ("/tmp", "/var/tmp"):
        more = "noexec" if folder in case.noexec else "exec"
        lines.append(tmpfs.format(mode="1777", more=more, at=folder))
    lines += [
        tmpfs.format(mode="755", more="noexec", at=folder)
        for folder in case.noexec
        if folder not in ("/tmp", "/var/tmp")
    ]
    data = shlex.quote(str(case.data))
    return [*lines, *(line.format(data=data, clone=clone) for line in case.before)]


def _interpreter_for_all() -> list[str]:
    """Lets an ordinary user run a Python that lies in root's home, say."""
    base = Path(sys.base_prefix).resolve()
    private = [folder for folder in base.parents if folder.stat().st_mode & 0o001 == 0]
    if not private:
        return []
    kept, at = PLACE / "python", shlex.quote(str(base))
    return [
        f"mkdir {kept}",
        f"mount --bind {at} {kept}",
        f"mount -t tmpfs -o mode=755 none {shlex.quote(str(private[-1]))}",
        f"mkdir -p {at}",
        f"mount --bind {kept} {at}",
    ]
