"""A process apart for work that may crash or use too much: it costs that work, and nothing else."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Final

import psutil

from buildarena_environment.errors import BuildarenaEnvironmentError
from buildarena_environment.processes import end_with_parent

LOOK_EVERY_S: Final = 0.1
"""How soon work that is given up is broken off."""
LONGEST_END_S: Final = 2.0


class ProcessEndedError(BuildarenaEnvironmentError):
    """The process ended in the middle of its work.

    Attributes:
        code: Its exit code, below 0 the signal that killed it; None when it is not known.
    """

    def __init__(self, name: str, code: int | None) -> None:
        super().__init__(f"the process of {name} ended with code {code}")
        self.code = code


class WarmProcess:
    """Answers questions one at a time in another process, which stays warm between them.

    It is started when it is first needed, and again after it ended. It ends with this process.

    Args:
        name: What it is called in messages.
        make: Called there first, makes what answers; both must be picklable by name.
        spare_bytes: Memory that it may take beyond what it has when it is ready; None for any.
    """

    def __init__(
        self,
        name: str,
        make: Callable[[], Callable[[Any], Any]],
        *,
        spare_bytes: int | None = None,
    ) -> None:
        self._name = name
        self._make = make
        self._spare_bytes = spare_bytes
        # Forking a process that has threads is not safe, and impossible on Windows.
        self._processes = multiprocessing.get_context("spawn")
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def start(self) -> None:
        """Starts the process, unless it runs."""
        if self._process is not None and self._process.is_alive():
            return
        self.close()
        self._pipe, theirs = self._processes.Pipe()
        self._process = self._processes.Process(
            target=_serve,
            args=(theirs, self._make, self._spare_bytes, os.getpid()),
            name=self._name,
            daemon=True,
        )
        self._process.start()
        theirs.close()

    def ask(self, question: Any, *, meanwhile: Callable[[], object] = lambda: None) -> Any:
        """What the process answers.

        Args:
            question: Anything that can be pickled.
            meanwhile: Called every now and then; what it raises ends the process and is raised.

        Raises:
            ProcessEndedError: It ended before it answered.
        """
        self.start()
        pipe = self._pipe
        assert pipe is not None  # noqa: S101 - it was started
        try:
            self._piped(lambda: pipe.send(question))
            while not self._piped(lambda: pipe.poll(LOOK_EVERY_S)):
                meanwhile()
            return self._piped(pipe.recv)
        except ProcessEndedError:
            raise
        except BaseException:
            self.close()  # it is still at work that nobody waits for
            raise

    def _piped(self, use: Callable[[], Any]) -> Any:
        try:
            return use()
        except (EOFError, OSError) as error:
            raise ProcessEndedError(self._name, self._ended()) from error

    def close(self) -> None:
        """Ends the process at once."""
        if self._process is not None:
            self._process.kill()
        self._ended()

    def _ended(self) -> int | None:
        process, self._process = self._process, None
        pipe, self._pipe = self._pipe, None
        if pipe is not None:
            pipe.close()
        if process is None:
            return None
        process.join(LONGEST_END_S)
        code = process.exitcode
        if code is not None:
            process.close()
        return code


def _serve(
    pipe: Connection,
    make: Callable[[], Callable[[Any], Any]],
    spare_bytes: int | None,
    parent: int,
) -> None:
    """Answers until the pipe is closed."""
    end_with_parent(parent)
    # Whoever presses Ctrl-C means the parent, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answer = make()
    if spare_bytes is not None:
        _limit_memory(spare_bytes)
    while True:
        try:
            question = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(answer(question))


def _limit_memory(spare_bytes: int) -> None:
    if sys.platform == "win32":
        return  # it has no such limit
    import resource

    most = psutil.Process().memory_info().vms + spare_bytes
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
