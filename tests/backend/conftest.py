from collections.abc import Callable

import pytest

from buildarena_backend.jobs.job import NewJobs
from buildarena_backend.process.context import Context


@pytest.fixture
def new_job() -> Callable[..., NewJobs]:
    def make(*seeds: int, model: str = "m") -> NewJobs:
        usual = {"task": "t", "task_version": "1", "model_hash": model, "model": model}
        usual |= {"track": "track", "model_config": {"name": model}, "track_config": {}}
        return NewJobs(**usual, seeds=seeds or [0])

    return make


@pytest.fixture
def add(context: Context, new_job: Callable[..., NewJobs]) -> Callable[..., list[str]]:
    """Adds jobs with these seeds and returns their ids."""

    def add_jobs(*seeds: int) -> list[str]:
        jobs = new_job(*seeds)
        with context.store.database.transaction() as connection:
            context.store.jobs.add([jobs], connection=connection)
        return jobs.job_ids

    return add_jobs
