"""Separate process for work that may crash or use too much: only that work is lost."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Final

import psutil

from buildarena_benchmark.environment.errors import BuildarenaEnvironmentError
from buildarena_benchmark.environment.trials.processes import (
    end_with_parent,
    forget_other_variables,
)

LOOK_EVERY_S: Final = 0.1
"""Interval of checks whether work in progress was given up."""
LONGEST_END_S: Final = 2.0


class ProcessEndedError(BuildarenaEnvironmentError):
    """The process ended in the middle of its work.

    Attributes:
        code: Exit code, below 0 the signal that killed it; None if unknown.
    """

    def __init__(self, name: str, code: int | None) -> None:
        super().__init__(f"the process of {name} ended with code {code}")
        self.code = code


class WarmProcess:
    """Process that answers questions one at a time, and stays warm between them.

    It is started when it is first needed, and again after it ended. It ends with this process.
    Another thread may close it at any time: a caller that waits for an answer then gets an error.

    Args:
        make: Called there first, returns the function that answers; both are picklable by name.
        spare_bytes: Memory limit beyond what the ready process has; None for any.
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
        # A process is started completely or not at all before another thread may end it.
        self._changing = threading.RLock()
        # On Linux a child is signalled when the thread that started it ends: this one never does.
        self._starter = ThreadPoolExecutor(1, thread_name_prefix=f"{name} starter")
        self._running: tuple[BaseProcess, Connection] | None = None

    @property
    def pid(self) -> int | None:
        """Process id; None when no process was started."""
        running = self._running
        return None if running is None else running[0].pid

    def start(self) -> Connection:
        """Start the process, unless it runs; return the pipe to it."""
        with self._changing:
            if self._running is not None and self._running[0].is_alive():
                return self._running[1]
            self.close()
            pipe, theirs = self._processes.Pipe()
            process = self._processes.Process(
                target=_serve,
                args=(theirs, self._make, self._spare_bytes, os.getpid()),
                name=self._name,
                daemon=True,
            )
            self._starter.submit(process.start).result()
            theirs.close()
            self._running = process, pipe
            return pipe

    def ask(self, question: Any, *, meanwhile: Callable[[], object] = lambda: None) -> Any:
        """Return the process's answer.

        Args:
            question: Anything that can be pickled.
            meanwhile: Called every now and then; its exceptions end the process and are raised.

        Raises:
            ProcessEndedError: It ended before it answered.
        """
        pipe = self.start()
        try:
            self._use_pipe(lambda: pipe.send(question))
            while not self._use_pipe(lambda: pipe.poll(LOOK_EVERY_S)):
                meanwhile()
            return self._use_pipe(pipe.recv)
        except ProcessEndedError:
            raise
        except BaseException:
            self.close()  # it is still at work, and no caller waits for it
            raise

    def _use_pipe(self, use: Callable[[], Any]) -> Any:
        try:
            return use()
        except (EOFError, OSError) as error:
            raise ProcessEndedError(self._name, self._end()) from error

    def close(self) -> None:
        """End the process at once."""
        self._end(kill=True)

    def _end(self, *, kill: bool = False) -> int | None:
        with self._changing:
            running, self._running = self._running, None
        if running is None:
            return None
        process, pipe = running
        if kill:
            process.kill()
        pipe.close()
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
    """Answer until the pipe is closed."""
    end_with_parent(parent)
    forget_other_variables()
    # Ctrl-C is for the parent, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answer = make()
    if spare_bytes is not None:
        limit_memory(spare_bytes)
    while True:
        try:
            question = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(answer(question))


def limit_memory(spare_bytes: int) -> None:
    """Limit this process's memory to what it has now and so many bytes more."""
    if sys.platform == "win32":
        return  # it has no such limit
    import resource

    limit = psutil.Process().memory_info().vms + spare_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
