from concurrent.futures import ThreadPoolExecutor

import pytest
from support.jobs import claim

from buildarena_store import NewJob, UnknownIdError
from buildarena_store.tables import jobs


def test_a_job_with_the_same_key_is_the_same_job(context, new_job, add) -> None:
    (first,) = add(1)
    with context.store.database.transaction() as connection:
        added = context.store.jobs.add([new_job(1), new_job(2)], connection=connection)
    assert added == 1
    assert context.store.jobs.get(first).seed == 1
    assert len(context.store.jobs.page(limit=10)) == 2


def test_jobs_are_claimed_in_the_order_in_which_they_were_given(context, new_job) -> None:
    seeds = [3, 1, 4, 15, 9, 2, 6, 5]
    given = [new_job(seed, model) for model in ("m", "n") for seed in seeds]
    with context.store.database.transaction() as connection:
        assert context.store.jobs.add([*given, given[0]], connection=connection) == len(given)
    claimed = [claim(context).job for _ in given]
    assert [(job.model, job.seed) for job in claimed] == [(j.model, j.key.seed) for j in given]
    assert all(job.model_config == {"name": job.model} for job in claimed)
    assert len({job.draw for job in claimed}) == len(given)


def test_sweeps_of_the_same_jobs_may_be_added_at_once(context, new_job) -> None:
    given = [new_job(seed) for seed in range(200)]

    def add(jobs: list[NewJob]) -> int:
        with context.store.database.transaction() as connection:
            return context.store.jobs.add(jobs, connection=connection)

    with ThreadPoolExecutor(4) as threads:
        added = list(threads.map(add, [given, given[::-1], given[::-1], given]))
    assert sorted(added) == [0, 0, 0, 200]


def test_an_unknown_id_is_named(context) -> None:
    with pytest.raises(UnknownIdError, match="there is no job 'job_x'"):
        context.store.jobs.get("job_x")


def test_pages_hold_every_job_once(context, add) -> None:
    ids = set(add(*range(7)))
    seen: list[str] = []
    after = None
    while page := context.store.jobs.page(limit=3, after=after):
        seen += [job.id for job in page]
        after = (page[-1].created_at, page[-1].id)
    assert len(seen) == 7
    assert set(seen) == ids


def test_a_cancelled_job_is_opened_again_when_it_is_wanted_again(context, new_job, add) -> None:
    (job_id,) = add(1)
    with context.store.database.transaction() as connection:
        assert context.store.jobs.cancel([job_id], connection=connection) == [job_id]
    assert context.store.jobs.get(job_id).outcome == "cancelled"
    with context.store.database.transaction() as connection:
        assert context.store.jobs.add([new_job(1)], connection=connection) == 1
    assert context.store.jobs.get(job_id).state == "queued"
    assert context.store.jobs.get(job_id).outcome is None


def test_only_errored_jobs_are_retried(context, add) -> None:
    (job_id,) = add(1)
    with context.store.database.transaction() as connection:
        assert not context.store.jobs.retry(jobs.c.id == job_id, connection=connection)
    lease = claim(context)
    context.store.leases.give_up(lease, "no key", reason="missing_key")
    assert context.store.jobs.get(job_id).outcome == "errored"
    with context.store.database.transaction() as connection:
        assert context.store.jobs.retry(jobs.c.id == job_id, connection=connection)
    assert context.store.jobs.get(job_id).state == "queued"


def test_what_happened_to_a_job_is_reported_in_order(context, add) -> None:
    (job_id,) = add(1)
    lease = claim(context)
    context.store.leases.hand_back(lease)
    kinds = [event.kind for event in context.store.events.after(0, job_id=job_id)]
    assert kinds == ["queued", "running", "queued"]
