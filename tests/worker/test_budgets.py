"""Sweeps with a budget, on the real database, in this process."""

from __future__ import annotations

from support.jobs import execute
from support.stages import work

from buildarena_pipeline.catalog.specs import Budget, SweepSpec

PAYLOAD = {"tasks": ["lift-1"], "models": ["builtin/expert"], "simulator": "mujoco"}


def test_a_sweep_stops_at_its_budget_and_goes_on_with_more(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0, 1, 2, 3, 4, 5], budget=Budget(max_requests=20))
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context, threads=4)
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    budget = context.store.budgets.get(sweep_id)
    assert budget.spent_requests == 20
    on_hold = context.store.jobs.page(limit=10, state="on_hold")
    assert on_hold
    assert all("max_requests is 20" in job.detail for job in on_hold if job.requests)

    again = submissions.submit_sweep(
        spec.model_copy(update={"budget": Budget(max_requests=10_000)}), resume=True
    )
    assert (again.sweep.id, again.resumed) == (sweep_id, True)
    work(context, threads=4)
    assert context.store.sweeps.progress(sweep_id).outcomes == {"success": 6}
    jobs = context.store.jobs.page(limit=10)
    # No reply was paid for twice: the budget knows of no request that the journals lack.
    journaled = sum(len(context.store.journal.read(job.id)) for job in jobs)
    assert context.store.budgets.get(sweep_id).spent_requests == journaled
    assert journaled == sum(job.requests for job in jobs)


def test_a_small_token_budget_stops_before_the_first_request(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0], budget=Budget(max_tokens=1000))
    sweep_id = submissions.submit_sweep(spec).sweep.id
    work(context, threads=4)
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    assert context.store.budgets.get(sweep_id).spent_requests == 0
    (job,) = context.store.jobs.page(limit=2)
    assert job.outcome is None
    assert "max_tokens is 1,000, 0 is spent" in job.detail


def test_what_costs_nothing_goes_on_when_the_dollars_are_used_up(
    context, submissions, monkeypatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "never-sent")
    models = ["openai/gpt-4o", "builtin/idle"]
    spec = SweepSpec(
        **{**PAYLOAD, "models": models}, seeds=[0, 1], budget=Budget(max_cost_usd=0.000001)
    )
    sweep_id = submissions.submit_sweep(spec).sweep.id
    # The dollars are used up before anything else has begun.
    execute(context, "UPDATE jobs SET queue = 'later' WHERE model = 'builtin/idle'")
    work(context, queues=("construct",))
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"
    execute(context, "UPDATE jobs SET queue = 'construct' WHERE model = 'builtin/idle'")
    work(context)
    progress = context.store.sweeps.progress(sweep_id)
    assert progress.stages == {"construct on_hold": 2}
    assert progress.outcomes == {"construction_failed": 2}
    assert context.store.sweeps.get(sweep_id).state == "budget_exhausted"


def test_resuming_a_finished_sweep_does_nothing_twice(context, submissions) -> None:
    spec = SweepSpec(**PAYLOAD, seeds=[0])
    first = submissions.submit_sweep(spec)
    work(context, threads=4)
    second = submissions.submit_sweep(spec, resume=True)
    assert (second.sweep.id, second.added) == (first.sweep.id, 0)
    other = submissions.submit_sweep(SweepSpec(**PAYLOAD, seeds=[0, 1]), resume=True)
    assert (other.resumed, other.added) == (False, 1)
