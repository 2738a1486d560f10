"""The contents of a dataset, requested from the service job by job."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from typing import Any, Final

from buildarena_cli.errors import CommandError
from buildarena_cli.ids import checked_id
from buildarena_cli.site.fetch import fetch
from buildarena_client.client import Client
from buildarena_client.paths import at

AT_ONCE: Final = 4
"""Jobs that are asked for at once; the service bounds the requests of one caller."""
PAGE: Final = 16
"""Jobs that are listed, and read before their rows are written: with machines and transcripts."""


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


def read_jobs(client: Client, **filters: Any) -> Iterator[Fetched]:
    """Yield the jobs that have ended, in the order in which they were submitted.

    Args:
        filters: Filters of the list of jobs.

    Raises:
        ClientError: A filter names what the service does not know.
        CommandError: Bytes arrived damaged.
    """

    @cache
    def task_of(name: str, version: str) -> Any:
        return json.loads(fetch(client, at("tasks", name), version=version) or "null")

    def read(job_id: str) -> Fetched | None:
        """Return a job with its documents; None when it is under way again."""
        job = json.loads(fetch(client, at("jobs", job_id)) or "null")
        if job is None or job["state"] != "done":
            return None
        stored = job["artifacts"].get("machine")
        machine = fetch(client, at("jobs", job_id, "machine")) if stored else None
        if machine is not None and sha256(machine).hexdigest() != stored:
            raise CommandError(f"the machine of {job_id} arrived damaged: its hash differs")
        prompts = fetch(client, at("jobs", job_id, "prompts"))
        return Fetched(
            job=job,
            task=task_of(job["task"], job["task_version"]),
            machine=machine,
            transcript=fetch(client, at("jobs", job_id, "transcript")),
            prompts=() if prompts is None else json.loads(prompts)["data"],
        )

    order: dict[str, Any] = {"state": "done", "sort": "created", "order": "asc", "limit": PAGE}
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for page in client.pages("/v1/jobs", **order, **filters):
            ids = [checked_id("job", job["id"]) for job in page["data"]]
            yield from filter(None, pool.map(read, ids))
