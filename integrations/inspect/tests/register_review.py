"""Does what registers do before they list an evaluation: register_review.py FOLDER [TASK...].

It clones what is committed into the folder, calls `uv sync` in the adapter's, lists the tasks of
its file, evaluates each by FILE@TASK with Inspect's mock model, evaluates a set of two, and retries
a log of which half is missing. Without names of tasks it evaluates all. It prints how many tasks
there are, and of each log its folder, status, version, number of samples, and task.
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
from pathlib import Path
from inspect_ai.log import read_eval_log
for file in sorted(Path(sys.argv[1]).glob("*/*.eval")):
    log = read_eval_log(str(file))
    print(file.parent.name, log.status, log.eval.task_version, len(log.samples), log.eval.task)
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

    def evaluate(self, task: str) -> None:
        """Evaluates a task."""
        words = [f"{FILE}@{task}", *MODEL, "--log-dir", self._logs / task]
        self._inspect(f"eval {task}", "eval", *words)

    def evaluate_set(self, *tasks: str) -> None:
        """Evaluates several tasks as a set."""
        files = [f"{FILE}@{task}" for task in tasks]
        self._inspect("eval-set", "eval-set", *files, *MODEL, "--log-dir", self._logs / "set")

    def retry(self, task: str) -> None:
        """Retries a log that lacks one of two epochs."""
        whole = self._logs / "whole"
        words = [f"{FILE}@{task}", *MODEL, "--epochs", "2", "--log-dir", whole]
        self._inspect(f"eval {task} twice", "eval", *words)
        (log,) = whole.glob("*.eval")
        half = self._logs / log.name
        self._step("halve a log", self._bin / "python", "-c", HALVE, log, half)
        self._inspect("eval-retry", "eval-retry", half, "--log-dir", self._logs / "again")

    def told(self) -> str:
        """What all logs say."""
        return self._step("read the logs", self._bin / "python", "-c", STATES, self._logs)

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
    for name in chosen:
        review.evaluate(name)
    review.evaluate_set(*chosen[:2])
    review.retry(chosen[0])
    sys.stdout.write(f"{len(names)} tasks\n{review.told()}")


if __name__ == "__main__":
    main()
