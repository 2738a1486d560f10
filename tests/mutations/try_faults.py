"""Tries the seeded faults: HEAD with one line wrong, and the tests that should say so.

A fault is caught where a test fails on it; one that survives shows what no test says. How faults
are written is in the README beside this file.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue
from typing import Final

import pytest

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parents[1]
MARKS: Final = "not ci and not nightly"
"""Which tests `make test` runs."""
UNTRACKED: Final = (
    "clients/python/src/buildarena_client/schemas.py",
    "services/api/src/buildarena_api/pages",
)
"""What tests need that is made and not committed."""
APPLIED_BY: Final = ((), ("-C1",), ("--3way",))
"""How a patch is applied, until it is: neighbouring lines may have changed since."""
LONGEST_S: Final = 3600.0
HEADER: Final = re.compile(r"^Fault: (\S+)\nBreaks: (.+)\nTests: (.+)\n\n", re.MULTILINE)
FAILED: Final = re.compile(r"^(?:FAILED|ERROR) (\S+?::.*?)(?: - .*)?$", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A wrong line, what it breaks, and where a test should say so, nearest first."""

    area: str
    name: str
    breaks: str
    tests: tuple[str, ...]
    patch: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What came of a fault: caught, survived, stale or error, and by which test or why."""

    area: str
    name: str
    breaks: str
    result: str
    by: str | None
    seconds: float


def faults_of(file: Path) -> Iterator[Fault]:
    """The faults of one area's file."""
    before, *fields = HEADER.split(file.read_text())
    if before or not fields or any("\nFault:" in patch for patch in fields[3::4]):
        raise SystemExit(f"{file.name}: each fault begins with Fault, Breaks and Tests")
    for name, breaks, tests, patch in zip(*[iter(fields)] * 4, strict=True):
        used = tuple(tests.split())
        yield Fault(area=file.stem, name=name, breaks=breaks, tests=used, patch=patch)


def run(
    tree: Path, *command: str, given: str | None = None, longest_s: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs a command in a tree, with the tree's packages before those that are installed."""
    own = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sources(tree)))}
    kept = {"text": True, "capture_output": True, "input": given, "timeout": longest_s}
    return subprocess.run(command, check=False, cwd=tree, env=own, **kept)


def git(tree: Path, *arguments: str, given: str | None = None) -> bool:
    """Runs git in a tree, and says whether it succeeded."""
    return run(tree, "git", *arguments, given=given).returncode == 0


def sources(tree: Path) -> list[Path]:
    """The folders that a tree's packages are imported from."""
    return [
        path for place in ("libs", "services", "clients") for path in tree.glob(f"{place}/*/src")
    ]


@contextmanager
def copy_of_head(folder: Path) -> Iterator[Path]:
    """A worktree of HEAD with what is made and not committed; it is gone after the block."""
    try:
        if not git(ROOT, "worktree", "add", "--detach", str(folder), "HEAD"):
            raise SystemExit(f"git can't make a worktree of HEAD in {folder}")
        for name in UNTRACKED:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, folder / name)
            elif (ROOT / name).exists():
                shutil.copy2(ROOT / name, folder / name)
        require_own_packages(folder)
        yield folder
    finally:
        git(ROOT, "worktree", "remove", "--force", str(folder))


def require_own_packages(tree: Path) -> None:
    """Ends the program where a package would come from elsewhere: no fault would be tried."""
    names = {path.parent.name for source in sources(tree) for path in source.glob("*/__init__.py")}
    program = (
        "import sys; from importlib.util import find_spec\n"
        "for name in sys.argv[1:]: print(find_spec(name).origin)"
    )
    asked = run(tree, sys.executable, "-c", program, *names)
    places = asked.stdout.splitlines()
    foreign = [place for place in places if not Path(place).is_relative_to(tree)]
    if asked.returncode or foreign or len(places) != len(names):
        raise SystemExit(f"packages do not come from {tree}: {foreign or asked.stderr}")


def tested(tree: Path, paths: Sequence[str], marks: str) -> tuple[str, str | None]:
    """What pytest says of a tree: survived, caught and by which test, or error and its end."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-rfE", "-p", "no:cacheprovider"]
    command += ["-m", marks, "-n", "2", "--dist", "loadgroup", *paths]
    try:
        ended = run(tree, *command, longest_s=LONGEST_S)
    except subprocess.TimeoutExpired:
        return "error", f"no end within {LONGEST_S:.0f} s"
    if ended.returncode == pytest.ExitCode.OK:
        return "survived", None
    if ended.returncode == pytest.ExitCode.NO_TESTS_COLLECTED:
        return "error", f"no test there has the marks {marks!r}"
    failed = FAILED.search(ended.stdout)
    return ("caught", failed[1]) if failed else ("error", (ended.stdout + ended.stderr)[-2000:])


def tried(tree: Path, fault: Fault, *, marks: str, whole: bool) -> Finding:
    """What comes of a fault in a tree, which is as it was afterwards."""
    since = time.monotonic()
    try:
        result, by = "stale", None
        if any(git(tree, "apply", *way, given=fault.patch) for way in APPLIED_BY):
            result, by = tested(tree, fault.tests, marks)
        if result == "survived" and whole:
            result, by = tested(tree, (), marks)
    finally:
        git(tree, "reset", "--hard", "--quiet")
    seconds = round(time.monotonic() - since, 1)
    told = {"area": fault.area, "name": fault.name, "breaks": fault.breaks}
    return Finding(**told, result=result, by=by, seconds=seconds)


def findings_of(faults: Sequence[Fault], given: argparse.Namespace) -> Iterator[Finding]:
    """Findings in the order of the faults, as they come; a tree has one fault at a time."""
    trees: Queue[Path] = Queue()

    def work(fault: Fault) -> Finding:
        tree = trees.get()
        try:
            return tried(tree, fault, marks=given.marks, whole=given.whole)
        finally:
            trees.put(tree)

    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="buildarena-faults-"))
        for number in range(given.jobs):
            trees.put(stack.enter_context(copy_of_head(Path(folder).resolve() / str(number))))
        if not given.skip_clean:
            paths = sorted({path for fault in faults for path in fault.tests})
            result, by = tested(trees.queue[0], paths, given.marks)
            if result != "survived":
                raise SystemExit(f"the tests do not pass without any fault: {result}, {by}")
        pool = stack.enter_context(ThreadPoolExecutor(given.jobs))
        yield from pool.map(work, faults)


def main() -> None:
    """Tries the faults that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="faults or areas; all by default")
    parser.add_argument("--marks", default=MARKS, help="which tests, as pytest's -m (%(default)s)")
    parser.add_argument("--whole", action="store_true", help="try all tests on what survives")
    parser.add_argument("--skip-clean", action="store_true", help="do not run the tests without")
    parser.add_argument("--json", type=Path, help="write what was found into this file")
    parser.add_argument("--jobs", type=int, default=1, help="faults that are tried at once")
    given = parser.parse_args()
    every = [fault for file in sorted(HERE.glob("*.patch")) for fault in faults_of(file)]
    unknown = set(given.names) - {name for fault in every for name in (fault.name, fault.area)}
    if unknown:
        parser.error(f"no fault or area is called {', '.join(sorted(unknown))}")
    faults = [f for f in every if not given.names or {f.name, f.area} & set(given.names)]
    findings = []
    for one in findings_of(faults, given):
        findings.append(one)
        say(f"{one.area:11} {one.name:42} {one.result:9} {one.seconds:6.1f} s  {one.by or ''}")
    for area in dict.fromkeys(fault.area for fault in faults):
        say(f"{area:11} {_summary([one for one in findings if one.area == area])}")
    say(_summary(findings))
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(one) for one in findings], indent=2) + "\n")
    sys.exit(any(one.result in {"stale", "error"} for one in findings))


def say(line: str) -> None:
    """Prints a line at once."""
    print(line, flush=True)  # noqa: T201 - its output


def _summary(findings: Sequence[Finding]) -> str:
    results = [one.result for one in findings]
    others = [f"{results.count(r)} {r}" for r in ("survived", "stale", "error") if r in results]
    return ", ".join([f"caught {results.count('caught')} of {len(results)}", *others])


if __name__ == "__main__":
    main()
