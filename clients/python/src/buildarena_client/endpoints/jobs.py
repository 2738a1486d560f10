"""Jobs, and what they left."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

from buildarena_client.endpoints.sending import PAGE, Sender
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
        """Jobs, the newest first by default, page after page as they are needed.

        Args:
            limit: How many at most; all by default.
            page: How many are asked for at once, 1 to 200.
            filters: Which jobs, and in which order.
        """
        return self._listed("/v1/jobs", limit, page, dict(filters))

    async def job_summary(self, **filters: Unpack[JobSummaryFilters]) -> JobSummary:
        """How many of some jobs ended how, for which reasons, and with which flags."""
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
        """Turns of all jobs in which words stand, in what was said or answered.

        Args:
            words: As search engines take them: ``"a phrase"``, ``or``, ``-not``.
            limit: Turns at most.
            task: Only of jobs on this task.
            model: Only of this model's jobs.
            sweep: Only of this sweep's jobs.
        """
        asked = {"text": words, "task": task, "model": model, "sweep": sweep}
        return self._listed("/v1/transcripts", limit, 50, asked)

    async def job(self, job_id: str) -> JobDetail:
        """A job with its manifest, attempts and artifacts."""
        return cast("JobDetail", await self.get(at("jobs", job_id)))

    async def submit_job(self, /, task: str, model: str, *, seed: int = 0, **more: Any) -> Job:
        """Submits one job; an equal one that is there already is the answer.

        Args:
            task: What is to be built.
            model: Who builds.
            seed: Which try it is.
            more: Further fields of a job's specification, such as ``simulator``.
        """
        body = {"task": task, "model": model, "seed": seed, **more}
        return cast("Job", await self.post("/v1/jobs", body, repeatable=True))

    async def cancel_job(self, job_id: str) -> Job:
        """Ends a job that has not ended."""
        return cast("Job", await self.post(at("jobs", job_id, "cancel")))

    async def retry_job(self, job_id: str) -> Job:
        """Queues an errored job again where it failed."""
        return cast("Job", await self.post(at("jobs", job_id, "retry")))

    async def verify_job(self, job_id: str) -> Verification:
        """Asks for a job's verification: a replay and a simulation, compared figure by figure."""
        return cast("Verification", await self.post(at("jobs", job_id, "verify")))

    async def verification(self, verification_id: str) -> Verification:
        """A verification and, once it is done, what it found."""
        return cast("Verification", await self.get(at("verifications", verification_id)))

    async def wait_for_job(self, job_id: str, *, timeout_s: float | None = None) -> JobDetail:
        """A job when it has ended.

        Raises:
            TimedOutError: It has not within the time.
        """
        return cast("JobDetail", await self._when(at("jobs", job_id), _done, timeout_s))

    async def wait_for_verification(
        self, verification_id: str, *, timeout_s: float | None = None
    ) -> Verification:
        """A verification when it is done.

        Raises:
            TimedOutError: It is not within the time.
        """
        path = at("verifications", verification_id)
        return cast("Verification", await self._when(path, _done, timeout_s))

    async def transcript(self, job_id: str) -> Any:
        """All turns of a job's session, of one under way those so far."""
        return await self.get(at("jobs", job_id, "transcript"))

    async def prompts(self, job_id: str) -> list[Prompt]:
        """What each role of a job's session was told before its turns."""
        return await self.every(at("jobs", job_id, "prompts"))

    async def machine(self, job_id: str) -> Any:
        """The machine document of a job."""
        return await self.get(at("jobs", job_id, "machine"))

    async def replay(self, job_id: str) -> Replay:
        """How a job's machine came about, step by step."""
        return cast("Replay", await self.get(at("jobs", job_id, "replay")))

    async def machine_model(self, job_id: str) -> bytes:
        """The shape of a job's machine, as GLB."""
        return await self.get_bytes(at("jobs", job_id, "machine.glb"))

    async def thumbnail(self, job_id: str) -> bytes:
        """A picture of a job's machine, as PNG."""
        return await self.get_bytes(at("jobs", job_id, "thumbnail.png"))

    async def scene(self, job_id: str, *, number: int = 0) -> Scene:
        """All that is needed to draw a trial of a job, besides its trajectory."""
        return cast("Scene", await self.get(at("jobs", job_id, "scene"), number=number))

    async def trajectory(self, job_id: str, *, number: int = 0) -> bytes:
        """The trajectory of a trial of a job, as Parquet."""
        return await self.get_bytes(at("jobs", job_id, "trajectory"), number=number)

    async def artifacts(self, job_id: str) -> list[Artifact]:
        """A job's artifacts with their sizes and hashes."""
        return await self.every(at("jobs", job_id, "artifacts"))

    async def artifact(self, job_id: str, name: str) -> bytes:
        """The bytes of a job's artifact, as they were kept.

        Raises:
            DamagedError: They arrived otherwise.
        """
        file = await self._file(job_id, name)
        data = await self.get_bytes(at("jobs", job_id, "artifacts", name))
        require_hash(BytesIO(data), file["sha256"], f"{name} of {job_id}")
        return data

    async def download_artifact(self, job_id: str, name: str, target: Path) -> None:
        """Writes a job's artifact into a file, which is there whole, as it was kept, or not at all.

        Raises:
            DamagedError: It arrived otherwise.
        """
        file = await self._file(job_id, name)
        path = at("jobs", job_id, "artifacts", name)
        await self.download(path, target, sha256=file["sha256"])

    def job_events(self, job_id: str, *, after: int = 0) -> AsyncGenerator[Event, None]:
        """What happens to a job, from the beginning; waits for more, over any number of cuts.

        Args:
            job_id: The job.
            after: The id of the last event that is known.
        """
        return self._events(at("jobs", job_id, "events"), after)

    async def _file(self, job_id: str, name: str) -> Artifact:
        files = await self.artifacts(job_id)
        known = {file["name"]: file for file in files}
        if name not in known:
            has = ", ".join(known) or "none yet"
            raise BadArgumentError(f"{job_id} has no file {name!r}; it has {has}")
        return known[name]


def _done(document: Any) -> bool:
    return bool(document["state"] == "done")
