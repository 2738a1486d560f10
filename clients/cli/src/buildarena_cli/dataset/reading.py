"""The contents of a dataset, requested from the service job by job."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from hashlib import sha256
from threading import Lock
from typing import Any, Final

from buildarena_cli.errors import CommandError
from buildarena_cli.ids import checked_id
from buildarena_cli.site.asking import ask
from buildarena_client.client import Client
from buildarena_client.paths import at

PAGE: Final = 200
"""Jobs that are listed at once, as many as the service gives."""
AT_ONCE: Final = 4
"""Jobs that are asked for at once; the service bounds the requests of one caller."""
AHEAD: Final = 16
"""Jobs that may be read before their rows are written: with their machines and transcripts."""
SUCCESS: Final = "success"


@dataclass(frozen=True, slots=True, kw_only=True)
class Filters:
    """Filters of ended jobs.

    Attributes:
        sweeps: Ids of sweeps; all jobs when there are none.
        tasks: Names; all when there are none.
        models: Names; all when there are none.
        track: A track's name; all without.
        success_only: Only jobs with the outcome `success`.
    """

    sweeps: Sequence[str] = ()
    tasks: Sequence[str] = ()
    models: Sequence[str] = ()
    track: str | None = None
    success_only: bool = False

    def take(self, job: Mapping[str, Any]) -> bool:
        """Return whether a job passes the filters that the service does not have."""
        if self.tasks and job["task"] not in self.tasks:
            return False
        return not self.models or job["model"] in self.models


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """A job as stored by the service.

    Attributes:
        task: The task in the job's version; None if the service no longer has it.
        machine: Stored machine document.
        prompts: The session's messages to its roles; empty if unknown.
    """

    job: Mapping[str, Any]
    task: Mapping[str, Any] | None
    machine: bytes | None
    transcript: bytes | None
    prompts: Sequence[Mapping[str, Any]] = ()


class Reader:
    """Reader of jobs, which requests some at once and returns them in order."""

    def __init__(self, client: Client, filters: Filters) -> None:
        self._client = client
        self._filters = filters
        self._tasks: dict[tuple[str, str], Mapping[str, Any] | None] = {}
        self._lock = Lock()

    def check(self) -> None:
        """Request one job of each filter, so that the service reports unknown filters.

        Raises:
            CommandError: A filter names what the service does not know.
        """
        filters = self._filters
        for name, values in (("task", filters.tasks), ("model", filters.models)):
            for value in values:
                self._client.get("/v1/jobs", limit=1, **{name: value})

    def jobs(self) -> Iterator[Fetched]:
        """Yield the jobs that have ended, in the order in which they were submitted.

        Raises:
            CommandError: A filter names what the service does not know, or bytes arrived damaged.
        """
        with ThreadPoolExecutor(AT_ONCE) as pool:
            waiting: list[Future[Fetched | None]] = []
            try:
                for id_ in self._ids():
                    waiting.append(pool.submit(self._fetched, id_))
                    if len(waiting) == AHEAD:
                        yield from _fetched_jobs(waiting.pop(0))
                while waiting:
                    yield from _fetched_jobs(waiting.pop(0))
            finally:
                for future in waiting:
                    future.cancel()

    def _ids(self) -> Iterator[str]:
        """Yield the ids of the jobs, without duplicates."""
        yielded: set[str] = set()
        for sweep in self._filters.sweeps or (None,):
            for job in self._listed(sweep):
                if job["id"] in yielded or not self._filters.take(job):
                    continue
                yielded.add(job["id"])
                yield checked_id("job", job["id"])

    def _listed(self, sweep: str | None) -> Iterator[Mapping[str, Any]]:
        filters = self._filters
        single = {
            "task": filters.tasks[0] if len(filters.tasks) == 1 else None,
            "model": filters.models[0] if len(filters.models) == 1 else None,
        }
        pages = self._client.pages(
            "/v1/jobs",
            sweep=sweep,
            track=filters.track,
            state="done",
            outcome=SUCCESS if filters.success_only else None,
            sort="created",
            order="asc",
            limit=PAGE,
            **single,
        )
        for page in pages:
            yield from page["data"]

    def _fetched(self, job_id: str) -> Fetched | None:
        """Return a job with its documents; None when it is under way again."""
        answer = ask(self._client, at("jobs", job_id))
        job = None if answer is None else json.loads(answer)
        if job is None or job["state"] != "done":
            return None
        hashes = job["artifacts"]
        machine = ask(self._client, at("jobs", job_id, "machine")) if "machine" in hashes else None
        if machine is not None and sha256(machine).hexdigest() != hashes["machine"]:
            raise CommandError(f"the machine of {job_id} arrived damaged: its hash differs")
        prompts = ask(self._client, at("jobs", job_id, "prompts"))
        return Fetched(
            job=job,
            task=self._task(job["task"], job["task_version"]),
            machine=machine,
            transcript=ask(self._client, at("jobs", job_id, "transcript")),
            prompts=() if prompts is None else json.loads(prompts)["data"],
        )

    def _task(self, name: str, version: str) -> Mapping[str, Any] | None:
        with self._lock:
            if (name, version) not in self._tasks:
                answer = ask(self._client, at("tasks", name), version=version)
                self._tasks[name, version] = None if answer is None else json.loads(answer)
            return self._tasks[name, version]


def _fetched_jobs(future: Future[Fetched | None]) -> Iterator[Fetched]:
    fetched = future.result()
    if fetched is not None:
        yield fetched
