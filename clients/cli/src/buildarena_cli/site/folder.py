"""The folder of a site: contents are stored once, and files appear only when complete.

``data`` holds answers under the hash of their content, ``jobs`` an index for each stored job,
``assets`` the pages' scripts. ``site.json`` and ``index.html`` are written last; until then an
older site in the folder stays as it was, and a new one has no page to open.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import re
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from threading import get_ident
from typing import Any, Final

from buildarena_cli.errors import CommandError

MARKER: Final = ".buildarena-site"
"""Says that a folder is ours to write in."""
VERSION: Final = "1"
DATA, JOBS, ASSETS = "data", "jobs", "assets"
_CONTENT: Final = re.compile(r"data/[0-9a-f]{2}/[0-9a-f]{38}\.[a-z]+")
MAX_NAMED: Final = 3


class Folder:
    """A folder that is empty or contains a site.

    Args:
        path: The folder; it need not exist.

    Raises:
        CommandError: It holds something else, or a site of a newer program.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._writing():
            self._check()

    def _check(self) -> None:
        path = self.path
        if path.exists() and not path.is_dir():
            raise CommandError(f"{path} is a file; --out names a folder")
        marker = path / MARKER
        if marker.is_file():
            version = marker.read_text(encoding="utf-8", errors="replace").strip()
            if version not in {VERSION, ""}:
                raise CommandError(f"{path} contains a site of another version: delete it")
        elif names := names_in(path):
            raise CommandError(
                f"{path} contains other files ({names}); name an empty folder, or a site's"
            )

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """Lock the folder for this process.

        Raises:
            CommandError: Another process writes in it, or it can't be written.
        """
        with self._writing():
            self.path.mkdir(parents=True, exist_ok=True)
            lock = (self.path / MARKER).open("a+", encoding="utf-8")
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise CommandError(f"another process is writing {self.path}") from error
            with self._writing():
                lock.truncate(0)
                lock.write(VERSION)
                lock.flush()
                yield

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise CommandError(f"{self.path} can't be written: {error.strerror}") from error

    def keep(self, content: bytes, ending: str) -> str:
        """Store a content once; return its path within the site."""
        digest = sha256(content).hexdigest()
        name = f"{DATA}/{digest[:2]}/{digest[2:40]}.{ending}"
        if not (self.path / name).is_file():
            self.write(name, content)
        return name

    def write(self, name: str, content: bytes) -> None:
        """Write a file atomically."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        # Threads may be at the same content at the same time.
        partial = target.with_name(f"{target.name}.{get_ident()}.partial")
        partial.write_bytes(content)
        partial.replace(target)

    def job_answers(self, job_id: str, digest: str) -> dict[str, str | None] | None:
        """Return the stored answers of a job.

        Args:
            digest: Digest of the job, see `digest_of`.

        Returns:
            Paths of files by request; None if some are missing, or the job has changed.
        """
        try:
            stored = json.loads((self.path / job_file(job_id)).read_bytes())
            answers: dict[str, str | None] = dict(stored["answers"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        names = [name for name in answers.values() if name is not None]
        complete = all(_CONTENT.fullmatch(name) and (self.path / name).is_file() for name in names)
        return answers if complete and stored.get("digest") == digest else None

    def keep_job(self, job_id: str, digest: str, answers: Mapping[str, str | None]) -> None:
        """Store the index of a job's answers for later runs."""
        self.write(job_file(job_id), as_json({"digest": digest, "answers": dict(answers)}))

    def remove_unlisted(self, paths: set[str]) -> None:
        """Remove files of earlier sites and of interrupted runs.

        Args:
            paths: Paths of the files that belong to the site.
        """
        for place in (DATA, JOBS, ASSETS):
            for file in sorted((self.path / place).rglob("*")):
                if file.is_file() and file.relative_to(self.path).as_posix() not in paths:
                    file.unlink()


def names_in(folder: Path) -> str:
    """Return the first names of what is in a folder; "" of an empty or missing one."""
    names = sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []
    return ", ".join(names[:MAX_NAMED]) + " …" * (len(names) > MAX_NAMED)


def job_file(job_id: str) -> str:
    """Return the path of a job's index within a site."""
    return f"{JOBS}/{job_id}.json"


def as_json(value: Any) -> bytes:
    """Return a value as compact JSON with sorted keys."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode()
