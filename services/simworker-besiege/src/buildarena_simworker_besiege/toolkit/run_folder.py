"""What a run of the toolkit's command line left: read in bounds, compared with what was asked."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Final

from buildarena_geometry.json_texts import read_json
from buildarena_simworker_besiege.errors import StepFailedError

SUMMARY, TELEMETRY, MANIFEST = "summary.json", "telemetry.csv", "input_manifest.json"
MAX_JSON: Final = 1 << 20
MAX_TELEMETRY: Final = 64 << 20
MAX_FOLDERS: Final = 10_000
"""Folders that are looked at for the one of a run."""
OK: Final = "ok"

_MAX_LEAVES: Final = 10_000
_MACHINE: Final = ("bsg", "machine")
_CONTROLLER: Final = ("controller", "timeline", "control")
_SANDBOX: Final = ("sandbox", "level", "scene")


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a run was asked for.

    Attributes:
        machine: The machine file.
        controller: The timeline.
        sandbox: The sandbox, or the level file.
        telemetry_hz: Samples a second.
    """

    machine: Path
    controller: Path
    sandbox: str
    telemetry_hz: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """The files of a finished run.

    Attributes:
        summary: As it came.
        manifest: As it came.
        telemetry: Its text.
    """

    summary: bytes
    manifest: bytes
    telemetry: str


def folders_with_summary(root: Path) -> set[Path]:
    """The folders below a root, itself included, in which there is a summary."""
    folders: set[Path] = set()
    for number, (folder, _, files) in enumerate(os.walk(root)):
        if number > MAX_FOLDERS:
            raise StepFailedError("find the run", f"more than {MAX_FOLDERS:,} folders in {root}")
        if SUMMARY in files:
            folders.add(Path(folder))
    return folders


def read_run(root: Path, before: set[Path], asked: Asked) -> RunFolder:
    """The run that a command left below a root.

    Args:
        root: Where the toolkit makes its folders.
        before: Those that were there before.
        asked: What it was told to play.

    Raises:
        StepFailedError: There is none or more than one, it did not end well, a file is missing or
            too large, or it says that something else was played.
    """
    new = folders_with_summary(root) - before
    if len(new) != 1:
        what = "no new run" if not new else f"{len(new)} new runs"
        raise StepFailedError("find the run", f"there are {what} with a {SUMMARY} in {root}")
    folder = new.pop()
    summary = _read(folder / SUMMARY, MAX_JSON)
    result = _object(summary, SUMMARY).get("result")
    if result != OK:
        raise StepFailedError("play the run", f"its result is {str(result)[:200]!r}, not {OK!r}")
    manifest = _read(folder / MANIFEST, MAX_JSON)
    require_asked(_object(manifest, MANIFEST), asked)
    data = _read(folder / TELEMETRY, MAX_TELEMETRY)
    try:
        telemetry = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise StepFailedError("read the telemetry", f"it is not UTF-8: {error}") from error
    return RunFolder(summary=summary, manifest=manifest, telemetry=telemetry)


def require_asked(manifest: dict[str, Any], asked: Asked) -> None:
    """Checks that a run was of what was asked for: a score of anything else would be wrong.

    A digest (`sha256`) is compared with the file's, a path by its name, a sandbox by its words; a
    manifest that names no machine, no controller or no sandbox is not believed.

    Raises:
        StepFailedError: It was of something else, or does not say of what.
    """
    named: set[str] = set()
    for path, value in _leaves(manifest):
        words = "_".join(path)
        for kind, names, file in (
            ("machine", _MACHINE, asked.machine),
            ("controller", _CONTROLLER, asked.controller),
        ):
            if not any(name in words for name in names) or not isinstance(value, str):
                continue
            if "sha256" in words:
                _require(kind, value.lower() == _digest(file), value)
                named.add(kind)
            elif _file_name(value).lower().endswith(file.suffix):
                _require(kind, _file_name(value) == file.name, value)
                named.add(kind)
        if path[-1] in _SANDBOX or path[-1].removesuffix("_name") in _SANDBOX:
            name = str(value).strip()
            same = name.casefold() == asked.sandbox.casefold()
            _require("sandbox", same or _file_name(name) == _file_name(asked.sandbox), value)
            named.add("sandbox")
        if path[-1] == "telemetry_hz":
            _require("rate", value == asked.telemetry_hz, value)
    silent = [kind for kind in ("machine", "controller", "sandbox") if kind not in named]
    if silent:
        finding = f"{MANIFEST} names no {' and no '.join(silent)}"
        raise StepFailedError("compare the run with what was asked", finding)


def _require(kind: str, same: bool, value: object) -> None:
    if not same:
        finding = f"the {kind} was {str(value)[:200]!r}, which is another"
        raise StepFailedError("compare the run with what was asked", finding)


def _leaves(value: object) -> Iterator[tuple[tuple[str, ...], object]]:
    """The values in a JSON object, each with the names that lead to it, in lower case."""
    open_: list[tuple[tuple[str, ...], object]] = [((), value)]
    for _ in range(_MAX_LEAVES):
        if not open_:
            return
        path, inner = open_.pop()
        if isinstance(inner, dict):
            open_ += [((*path, str(name).lower()), each) for name, each in inner.items()]
        elif isinstance(inner, list):
            open_ += [(path, each) for each in inner]
        elif path:
            yield path, inner
    raise StepFailedError("compare the run with what was asked", f"{MANIFEST} is too long")


def _file_name(text: str) -> str:
    """A path's last part, whichever system wrote it."""
    return PurePosixPath(PureWindowsPath(text).as_posix()).name


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _object(data: bytes, name: str) -> dict[str, Any]:
    try:
        content: object = read_json(data.decode("utf-8-sig"))
    except ValueError as error:
        raise StepFailedError("read the run", f"{name} is not valid JSON: {error}") from error
    if not isinstance(content, dict):
        raise StepFailedError("read the run", f"{name} is not an object")
    return content


def _read(file: Path, most: int) -> bytes:
    try:
        if not stat.S_ISREG(file.lstat().st_mode):
            raise StepFailedError("read the run", f"{file.name} is not a file")
        with file.open("rb") as stream:
            data = stream.read(most + 1)
    except OSError as error:
        raise StepFailedError("read the run", f"{file.name}: {error.strerror}") from error
    if len(data) > most:
        raise StepFailedError("read the run", f"{file.name} has more than {most:,} bytes")
    return data
