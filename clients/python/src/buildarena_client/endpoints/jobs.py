"""Jobs, and what they left."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

from buildarena_client.endpoints.base import PAGE, Sender
from buildarena_client.errors import BadArgumentError
from buildarena_client.event_streams import Event
from buildarena_client.files import require_hash
from buildarena_client.paths import at

if TYPE_CHECKING:
    from buildarena_client.schemas import (
        Artifact,
        Job,
        JobDetail,
        JobFilters,
        JobSummary,
        JobSummaryFilters,
        Prompt,
        Replay,
        Scene,
        TranscriptMatch,
        Verification,
    )


class Jobs(Sender):
    """Jobs, and what they left."""

    def jobs(
        self, *, limit: int | None = None, page: int = PAGE, **filters: Unpack[JobFilters]
    ) -> AsyncGenerator[Job, None]:
        """Yield jobs, the newest first by default, page after page as needed.

        Args:
            limit: Maximum number of rows. Defaults to all.
            page: Rows per request, 1 to 200.
            filters: Filters and order of the jobs.
        """
        return self._listed("/v1/jobs", limit, page, dict(filters))

    async def job_summary(self, **filters: Unpack[JobSummaryFilters]) -> JobSummary:
        """Return the numbers of some jobs by result, failure reason and flag."""
        return cast("JobSummary", await self.get("/v1/jobs/summary", **filters))

    def search_transcripts(
        self,
        words: str,
        *,
        limit: int | None = 50,
        task: str | None = None,
        model: str | None = None,
        sweep: str | None = None,
    ) -> AsyncGenerator[TranscriptMatch, None]:
        """Yield turns of all jobs whose messages contain the words.

        Args:
            words: Search expression: ``"a phrase"``, ``or``, ``-not``.
            limit: Maximum number of turns.
            task: Task to search. Defaults to all.
            model: Model to search. Defaults to all.
            sweep: Sweep to search. Defaults to all.
        """
        asked = {"text": words, "task": task, "model": model, "sweep": sweep}
        return self._listed("/v1/transcripts", limit, 50, asked)

    async def job(self, job_id: str) -> JobDetail:
        """Return a job with its manifest, attempts and artifacts."""
        return cast("JobDetail", await self.get(at("jobs", job_id)))

    async def submit_job(self, /, task: str, model: str, *, seed: int = 0, **more: Any) -> Job:
        """Submit one job; an equal existing one is returned instead.

        Args:
            task: Task to build for.
            model: Builder.
            seed: Number of the try.
            more: Further fields of a job's specification, such as ``simulator``.
        """
        body = {"task": task, "model": model, "seed": seed, **more}
        return cast("Job", await self.post("/v1/jobs", body, repeatable=True))

    async def cancel_job(self, job_id: str) -> Job:
        """Cancel a job that has not ended."""
        return cast("Job", await self.post(at("jobs", job_id, "cancel")))

    async def retry_job(self, job_id: str) -> Job:
        """Queue an errored job again from the stage that failed."""
        return cast("Job", await self.post(at("jobs", job_id, "retry")))

    async def verify_job(self, job_id: str) -> Verification:
        """Request a job's verification: a replay and a simulation, compared figure by figure."""
        return cast("Verification", await self.post(at("jobs", job_id, "verify")))

    async def verification(self, verification_id: str) -> Verification:
        """Return a verification with its findings, once it is done."""
        return cast("Verification", await self.get(at("verifications", verification_id)))

    async def wait_for_job(self, job_id: str, *, timeout_s: float | None = None) -> JobDetail:
        """Wait until a job has ended, and return it.

        Raises:
            TimedOutError: It has not ended within the time.
        """
        return cast("JobDetail", await self._when(at("jobs", job_id), _done, timeout_s))

    async def wait_for_verification(
        self, verification_id: str, *, timeout_s: float | None = None
    ) -> Verification:
        """Wait until a verification is done, and return it.

        Raises:
            TimedOutError: It is not done within the time.
        """
        path = at("verifications", verification_id)
        return cast("Verification", await self._when(path, _done, timeout_s))

    async def transcript(self, job_id: str) -> Any:
        """Return all turns of a job's session, or those so far if it is running."""
        return await self.get(at("jobs", job_id, "transcript"))

    async def prompts(self, job_id: str) -> list[Prompt]:
        """Return the initial messages to each role of a job's session."""
        return await self.every(at("jobs", job_id, "prompts"))

    async def machine(self, job_id: str) -> Any:
        """Return the machine document of a job."""
        return await self.get(at("jobs", job_id, "machine"))

    async def replay(self, job_id: str) -> Replay:
        """Return the construction of a job's machine, step by step."""
        return cast("Replay", await self.get(at("jobs", job_id, "replay")))

    async def machine_model(self, job_id: str) -> bytes:
        """Return the shape of a job's machine, as GLB."""
        return await self.get_bytes(at("jobs", job_id, "machine.glb"))

    async def thumbnail(self, job_id: str) -> bytes:
        """Return a picture of a job's machine, as PNG."""
        return await self.get_bytes(at("jobs", job_id, "thumbnail.png"))

    async def scene(self, job_id: str, *, number: int = 0) -> Scene:
        """Return all data needed to draw a trial of a job, besides its trajectory."""
        return cast("Scene", await self.get(at("jobs", job_id, "scene"), number=number))

    async def trajectory(self, job_id: str, *, number: int = 0) -> bytes:
        """Return the trajectory of a trial of a job, as Parquet."""
        return await self.get_bytes(at("jobs", job_id, "trajectory"), number=number)

    async def artifacts(self, job_id: str) -> list[Artifact]:
        """Return a job's artifacts with their sizes and hashes."""
        return await self.every(at("jobs", job_id, "artifacts"))

    async def artifact(self, job_id: str, name: str) -> bytes:
        """Return the bytes of a job's artifact, as stored.

        Raises:
            DamagedError: They arrived damaged.
        """
        file = await self._file(job_id, name)
        data = await self.get_bytes(at("jobs", job_id, "artifacts", name))
        require_hash(BytesIO(data), file["sha256"], f"{name} of {job_id}")
        return data

    async def download_artifact(self, job_id: str, name: str, target: Path) -> None:
        """Write a job's artifact into a file, complete and as stored, or not at all.

        Raises:
            DamagedError: It arrived damaged.
        """
        file = await self._file(job_id, name)
        path = at("jobs", job_id, "artifacts", name)
        await self.download(path, target, sha256=file["sha256"])

    def job_events(self, job_id: str, *, after: int = 0) -> AsyncGenerator[Event, None]:
        """Yield the events of a job from the beginning, and wait for more across disconnections.

        Args:
            after: Id of the last known event.
        """
        return self._events(at("jobs", job_id, "events"), after)

    async def _file(self, job_id: str, name: str) -> Artifact:
        files = await self.artifacts(job_id)
        files_by_name = {file["name"]: file for file in files}
        if name not in files_by_name:
            has = ", ".join(files_by_name) or "none yet"
            raise BadArgumentError(f"{job_id} has no file {name!r}; it has {has}")
        return files_by_name[name]


def _done(document: Any) -> bool:
    return bool(document["state"] == "done")
