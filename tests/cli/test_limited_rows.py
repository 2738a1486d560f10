"""What the leaderboard says of jobs with limits."""

from support.clients.commands import printed
from support.stages import work

from buildarena_pipeline.catalog.specs import Limits, SweepSpec

SPEC = SweepSpec(tasks=["lift-1"], models=["builtin/expert"], seeds=[0, 1], simulator="mujoco")


def test_rows_of_limited_jobs_say_so(context, submissions, url) -> None:
    for limits in (Limits(), Limits(max_requests=1)):
        spec = SPEC.model_copy(update={"models": ["builtin/idle"], "limits": limits})
        submissions.submit_sweep(spec)
    work(context)
    board = printed(url, "leaderboard")
    assert "builtin/idle* (max_requests 1)" in board
    assert "†" not in board
