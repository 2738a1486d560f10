"""What the command line says of results that were imported, and of limits."""

import pytest
from support.clients.commands import printed
from support.servers.databases import empty
from support.stages import work

from buildarena_pipeline.catalog.specs import Limits, SweepSpec
from buildarena_store.archives import write_archive
from buildarena_worker.wiring import verification_runner

SPEC = SweepSpec(tasks=["lift-1"], models=["builtin/expert"], seeds=[0, 1], simulator="mujoco")


@pytest.mark.ci
def test_imported_results_are_marked_until_and_after_they_count(
    context, submissions, url, tmp_path
) -> None:
    sweep_id = submissions.submit_sweep(SPEC).sweep.id
    work(context)
    file = tmp_path / "sweep.zip"
    write_archive(context.store.database, context.artifacts, sweep_id, file)
    empty(context.store.database)
    said = printed(url, "sweep", "import", str(file))
    assert "2 jobs, 2 of them new" in said
    assert "2 scores count when" in said
    board = printed(url, "leaderboard")
    assert "builtin/expert*†" in board
    assert "2 were imported" in board
    assert "2 wait for their verification, 0 were refuted: they count nowhere" in board
    job = context.store.jobs.page(limit=1)[0]
    assert f"an archive of {sweep_id}" in printed(url, "job", "show", job.id)
    assert "waits for its verification: it counts nowhere" in printed(url, "job", "show", job.id)
    while verification_runner(context).process_one():
        pass
    board = printed(url, "leaderboard")
    assert "2 were imported" in board
    assert "count nowhere" not in board
    assert "verified at" in printed(url, "job", "show", job.id)
    assert "2/2" in printed(url, "leaderboard", "--task", "lift-1")


def test_rows_of_limited_jobs_say_so(context, submissions, url) -> None:
    for limits in (Limits(), Limits(max_requests=1)):
        spec = SPEC.model_copy(update={"models": ["builtin/idle"], "limits": limits})
        submissions.submit_sweep(spec)
    work(context)
    board = printed(url, "leaderboard")
    assert "builtin/idle* (max_requests 1)" in board
    assert "†" not in board
