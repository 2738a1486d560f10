"""A sweep's budget and what is to come of it, on the command line."""

import pytest
from support.clients.commands import printed, run_cli
from support.jobs import execute

from buildarena_pipeline.catalog.specs import SweepSpec


@pytest.fixture
def sweep(submissions) -> str:
    spec = SweepSpec(tasks=["lift-1"], models=["builtin/expert"], samples=10, simulator="mujoco")
    return submissions.submit_sweep(spec).sweep.id


def test_a_budget_is_set_while_a_sweep_runs_and_after_it_was_used_up(url, context, sweep) -> None:
    assert "$0.00 of $5.00" in printed(url, "sweep", "budget", sweep, "--max-cost-usd", "5")
    with context.store.lifecycle.command() as connection:
        context.store.lifecycle.exhaust(sweep, "used up", connection=connection)
    stopped = printed(url, "sweep", "status", sweep)
    assert "stopped, as its budget is used up" in stopped
    assert "10  on hold before they are built" in stopped
    assert f"buildarena sweep budget {sweep} --max-cost-usd" in stopped
    shown = printed(url, "sweep", "budget", sweep, "--max-cost-usd", "7")
    assert ": active\n" in shown
    assert "10  waiting to be built" in shown
    refused = run_cli(url, "sweep", "budget", sweep)
    assert refused.returncode == 2
    assert "--max-requests" in refused.stderr


def test_status_says_what_is_to_come_as_the_service_does(url, context, sweep) -> None:
    printed(url, "sweep", "budget", sweep, "--max-cost-usd", "1")
    execute(context, "UPDATE events SET at = now() - interval '10 minutes'")
    execute(
        context,
        "UPDATE jobs SET state = 'done', outcome = 'success', success = true, cost_usd = 0.5, "
        "finished_at = now() WHERE seed < 5",
    )
    lines = printed(url, "sweep", "status", sweep).splitlines()
    assert any(line.startswith("5 jobs left at 0.5 a minute: ends about 20") for line in lines)
    assert "about $2.50 still to spend, $5.00 in all" in lines
    assert "the budget lacks about $1.50 for that" in lines
