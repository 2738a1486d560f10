from collections.abc import Callable

import pytest

from buildarena_backend.jobs.job import JobKey, NewJob
from buildarena_backend.process.context import Context


@pytest.fixture
def new_job() -> Callable[..., NewJob]:
    def make(seed: int = 0, model: str = "m") -> NewJob:
        key = JobKey(task="t", task_version="1", model_hash=model, track="track", seed=seed)
        return NewJob(key=key, model=model, model_config={"name": model}, track_config={})

    return make


@pytest.fixture
def add(context: Context, new_job: Callable[..., NewJob]) -> Callable[..., list[str]]:
    """Adds jobs with these seeds and returns their ids."""

    def add_jobs(*seeds: int) -> list[str]:
        jobs = [new_job(seed) for seed in seeds]
        with context.store.database.transaction() as connection:
            context.store.jobs.add(jobs, connection=connection)
        return [job.key.job_id for job in jobs]

    return add_jobs
