"""Does what a register of evaluations does before it lists one: register_review.py FOLDER [TASK...].

It clones what is committed into the folder, calls `uv sync` in the adapter's, lists the tasks of its file,
evaluates each by FILE@TASK with Inspect's mock model, evaluates a set of two, and retries a log of which
half is missing. Without names of tasks it evaluates all.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[3]
FILE = "src/buildarena_inspect/tasks.py"
MODEL = ("--model", "mockllm/model")
HALVE = """
import sys
from inspect_ai.log import read_eval_log, write_eval_log
log = read_eval_log(sys.argv[1])
log.status, log.samples = "cancelled", log.samples[:1]
write_eval_log(log, sys.argv[2])
"""
STATES = """
import sys
from inspect_ai.log import list_eval_logs, read_eval_log
for info in list_eval_logs(sys.argv[1]):
    log = read_eval_log(info)
    print(log.status, log.eval.task_version, len(log.samples), log.eval.task)
"""


class Review:
    """A clone, and what is done in it.

    Args:
        folder: Where it is made.
    """

    def __init__(self, folder: Path) -> None:
        self._adapter = folder / "clone/integrations/inspect"
        self._bin = self._adapter / ".venv/bin"
        self._logs = folder / "logs"
        self._step("clone", "git", "clone", "--quiet", ROOT, folder / "clone", at=folder)
        self._step("uv sync", "bash", ROOT / "mk/uv.sh", "sync", "--project", self._adapter)

    def listed(self) -> list[str]:
        """The tasks that Inspect finds in the file."""
        told = self._inspect("list tasks", "list", "tasks", FILE)
        return [line.partition("@")[2] for line in told.split()]

    def evaluate(self, task: str) -> list[str]:
        """Evaluates a task; what its log says."""
        folder = self._logs / task
        self._inspect(f"eval {task}", "eval", f"{FILE}@{task}", *MODEL, "--log-dir", folder)
        return self._states(folder)

    def evaluate_set(self, *tasks: str) -> list[str]:
        """Evaluates several as a set; what their logs say."""
        folder = self._logs / "set"
        files = [f"{FILE}@{task}" for task in tasks]
        self._inspect("eval-set", "eval-set", *files, *MODEL, "--log-dir", folder)
        return self._states(folder)

    def retry(self, task: str) -> list[str]:
        """Retries a log that lacks one of two epochs; what the new log says."""
        whole, again = self._logs / "whole", self._logs / "again"
        words = [f"{FILE}@{task}", *MODEL, "--epochs", "2", "--log-dir", whole]
        self._inspect(f"eval {task} twice", "eval", *words)
        (log,) = whole.glob("*.eval")
        half = self._logs / log.name
        self._step("halve a log", self._bin / "python", "-c", HALVE, log, half)
        self._inspect("eval-retry", "eval-retry", half, "--log-dir", again)
        return self._states(again)

    def _states(self, folder: Path) -> list[str]:
        told = self._step(f"read {folder.name}", self._bin / "python", "-c", STATES, folder)
        return told.splitlines()

    def _inspect(self, name: str, *words: object) -> str:
        return self._step(name, self._bin / "inspect", *words)

    def _step(self, name: str, *words: object, at: Path | None = None) -> str:
        started = time.monotonic()
        done = subprocess.run(
            [str(word) for word in words],
            cwd=at or self._adapter,
            env={
                **{key: value for key, value in os.environ.items() if key != "VIRTUAL_ENV"},
                "PYTHONPATH": str(Path(__file__).with_name("offline")),
                "TERM": "dumb",
            },
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise SystemExit(f"{name} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        sys.stderr.write(f"{name}: {time.monotonic() - started:.1f} s\n")
        return done.stdout


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    review = Review(folder)
    names = review.listed()
    chosen = sys.argv[2:] or names
    print(len(names), "tasks")
    for name in chosen:
        print(*review.evaluate(name))
    print(*review.evaluate_set(*chosen[:2]), sep="\n")
    print(*review.retry(chosen[0]))


if __name__ == "__main__":
    main()
