"""Submissions, calls of agents, which rollout counts, and how transcripts are written."""

from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import Any

import pytest
from pydantic import ValidationError
from support.servers.live_api import changed

from buildarena_backend.agents.turn_views import turn_of_call
from buildarena_backend.agents.workbench import MAX_BYTES, MAX_DEPTH, check_arguments
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import JobSpec, SweepSpec
from buildarena_backend.catalog.tracks import is_paper, session_limits, worlds_of
from buildarena_backend.errors import SubmissionError
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.external_calls import ExternalCall
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.journal.transcript import ActionResult, ModelTurn, Transcript
from buildarena_backend.states import JobState
from buildarena_backend.submission.submission import Submissions
from buildarena_backend.trials.scoring import best_rollout, rollout_score
from buildarena_benchmark import builtin_tasks

MODELS = ["builtin/expert", "builtin/idle"]


def spec(**changes: object) -> SweepSpec:
    given = {"tasks": ["support-1"], "models": MODELS, "seeds": [0, 1, 2], **changes}
    return SweepSpec.model_validate(given)


def test_a_sweep_is_the_product_of_its_lists_and_adds_no_job_twice(context, submissions) -> None:
    done = submissions.submit_sweep(spec())
    assert (done.jobs, done.added) == (6, 6)
    jobs = context.store.jobs.page(limit=100, sweep_id=done.sweep.id)
    assert {(job.model, job.seed) for job in jobs} == {(m, s) for m in MODELS for s in (0, 1, 2)}
    context.queues.settle()
    assert context.queues.waiting("construct") == 6
    again = submissions.submit_sweep(spec(models=[*MODELS, "builtin/random", *MODELS]))
    assert (again.jobs, again.added) == (9, 3)
    assert context.store.sweeps.progress(again.sweep.id).total == 9


def test_what_is_asked_for_otherwise_is_another_job(submissions) -> None:
    changes = ({}, {}, {"decoding": {"temperature": 0}}, {"simulator": "mujoco"})
    changes += ({"workflow": "builder"}, {"seed": 1})
    specs = [JobSpec(task="support-1", model="builtin/idle", **change) for change in changes]
    made = [submissions.submit_job(one) for one in specs]
    assert [new for _, new in made] == [True, False, True, True, True, True]
    assert len({job.id for job, _ in made}) == 5


def test_everything_that_is_wrong_is_named_with_the_choices(context, submissions) -> None:
    wrong = {"models": ["gpt"], "simulator": "moon", "workflow": "x"}
    with pytest.raises(SubmissionError) as caught:
        submissions.submit_sweep(spec(tasks=["support-1", "support-9"], **wrong))
    errors = {issue.path: issue for issue in caught.value.issues}
    assert set(errors) == {"tasks[1]", "models[0]", "simulator", "workflow"}
    assert "support-1" in errors["tasks[1]"].choices
    assert "builtin/expert" in errors["models[0]"].choices
    assert set(errors["simulator"].choices) == {"pybullet", "mujoco"}
    for workflow in ("builder", "guidance-builder"):
        with pytest.raises(SubmissionError) as caught:
            submissions.submit_sweep(spec(tasks=["lift-2", "lift-3"], workflow=workflow))
        (issue,) = caught.value.issues
        assert (issue.path, issue.choices) == ("tasks[1]", ("five-role",))
        assert "lift-3 asks for several sub-structures" in issue.message
    with pytest.raises(SubmissionError, match="200,000 jobs; the largest accepted has 100,000"):
        submissions.submit_sweep(spec(seeds=None, samples=100_000))
    assert context.store.jobs.page(limit=1) == []
    assert spec(seeds=None).all_seeds() == list(range(64)), "as in the paper"


def test_work_goes_on_when_the_broker_is_gone(context) -> None:
    with changed(context, broker_url="redis://127.0.0.1:1/0") as lonely:
        assert Submissions(lonely, load_registry()).submit_sweep(spec()).added == 6
        assert lonely.queues.waiting("construct") is None


def lists(levels: int, inner: Any) -> Any:
    for _ in range(levels):
        inner = [inner]
    return inner


def objects(levels: int, inner: Any) -> Any:
    for _ in range(levels):
        inner = {"k": inner}
    return inner


def test_arguments_of_an_agents_call_are_bounded() -> None:
    for arguments in (
        *(lists(MAX_DEPTH, 1), objects(MAX_DEPTH, "x"), lists(MAX_DEPTH - 1, {}), None),
        *([1, "x", objects(MAX_DEPTH - 1, None)], "x" * (MAX_BYTES - 2)),
    ):
        check_arguments(arguments)
    for arguments in (
        *(lists(MAX_DEPTH + 1, 1), objects(MAX_DEPTH + 1, "x"), lists(MAX_DEPTH, {})),
        [1, "x", objects(MAX_DEPTH // 2, lists(MAX_DEPTH // 2, None))],
        objects(5_000, 1),
    ):
        with pytest.raises(SubmissionError, match="more than 20 arrays or objects inside each"):
            check_arguments(arguments)
    with pytest.raises(SubmissionError, match="65,537 bytes"):
        check_arguments("x" * (MAX_BYTES - 1))


def test_of_rollouts_an_honest_success_comes_first_then_the_larger_indicator() -> None:
    nothing = dict.fromkeys(RolloutRecord.__dataclass_fields__)
    nothing["finished_at"] = datetime(2026, 1, 1, tzinfo=UTC)
    for rollouts, best in [
        ([(False, 90.0, ()), (True, 20.0, ())], 1),
        ([(True, 20.0, ()), (True, 30.0, ())], 1),
        ([(True, 20.0, ()), (True, 20.0, ())], 0),
        ([(True, 90.0, ("no_wheels",)), (True, 20.0, ())], 1),
        ([(True, 90.0, ("never_fell",)), (True, 20.0, ())], 0),
        ([(False, 9.0, ()), (True, 90.0, ("no_wheels",))], 1),
    ]:
        usual = [
            {"number": n, "success": s, "indicator": i, "flags": f}
            for n, (s, i, f) in enumerate(rollouts)
        ]
        made = [RolloutRecord(**nothing | one) for one in usual]
        best_found = best_rollout(made, replace(builtin_tasks()["transport-1"], test_trials=0))
        assert best_found.number == best, rollouts


def test_a_jobs_score_is_the_mean_over_its_worlds_of_which_the_exact_one_is_one(subtests) -> None:
    task, engine = builtin_tasks()["transport-1"], "mujoco"
    values = dict.fromkeys(field.name for field in fields(Job)) | {"state": JobState.DONE}
    job = Job(**values | {"model_config": {}, "track_config": {}, "seed": 0, "task": task.name})
    empty = dict.fromkeys(field.name for field in fields(RolloutRecord)) | {"engine": engine}
    empty["finished_at"] = datetime(2026, 1, 1, tzinfo=UTC)
    flagged = ("no_wheels",)
    for worlds, outcome, success, indicator in [
        ([(True, 20.0, ())], "success", 1.0, 20.0),
        ([(False, 20.0, ())], "unsuccessful", 0.0, 0.0),
        ([(False, 9.0, ()), (True, 20.0, ()), (True, 40.0, ())], "success", 2 / 3, 20.0),
        ([(True, 30.0, ()), (False, 9.0, ()), (False, 9.0, ())], "unsuccessful", 1 / 3, 10.0),
        ([(True, 30.0, ()), (True, 90.0, flagged)], "success", 0.5, 15.0),
        ([(True, 30.0, flagged), (True, 30.0, ())], "success", 0.5, 15.0),
    ]:
        made = [
            RolloutRecord(
                **empty
                | {"number": n, "success": s, "indicator": i, "flags": f}
                | {"final": True, "seed": n or None}
            )
            for n, (s, i, f) in enumerate(worlds)
        ]
        test = replace(made[0], number=9, final=False, seed=7, indicator=1e6)
        with subtests.test(worlds=worlds):
            found = rollout_score(job, task, [test, *made])
            assert (found.outcome, found.success) == (outcome, success)
            assert found.indicator == pytest.approx(indicator)
            paper = rollout_score(replace(job, track_config={"paper": True}), task, made)
            assert (paper.outcome == "excluded") == (worlds[0][2] == flagged)


def test_the_papers_protocol_is_a_track_of_its_own_with_the_exact_world_alone(submissions) -> None:
    (plain,), (paper,) = (
        submissions.plan(spec(models=["openai/gpt-4o"], paper=paper)) for paper in (False, True)
    )
    assert plain.track != paper.track
    assert (worlds_of(paper.track_config), is_paper(paper.track_config)) == (0, True)
    assert session_limits(paper.track_config, {}) == {}
    assert session_limits(plain.track_config, {})["max_requests"] == 1500
    assert submissions.estimate(spec(models=["openai/gpt-4o"], paper=True))["max_cost_usd"] is None
    with pytest.raises(SubmissionError, match=r"paper's task.*support-4"):
        submissions.plan(spec(tasks=["support-4"], paper=True))
    with pytest.raises(ValidationError, match="leave `worlds` out"):
        spec(worlds=4, paper=True)


REFUSED = {"arguments": {"n": [1, "ü"]}, "ok": False, "reason": "block_presence", "feedback": "No."}


def test_a_models_transcript_has_no_blanks_and_tells_what_each_turn_cost() -> None:
    said = {"stage": "build", "sub_structure": None, "role": "builder", "text": ""}
    paid = {"input_tokens": 10, "output_tokens": 5, "cost_usd": "0.000001"}
    made = {"actions": (ActionResult(name="start", **REFUSED),), "finish": "stop"}
    turn = ModelTurn(index=0, **said, **made, **paid, latency_s=1.0, tries=1)
    assert Transcript([turn]).to_json().decode() == (
        '{"version":"1","turns":[{"index":0,"stage":"build","sub_structure":null,"role":"builder",'
        '"text":"","actions":[{"name":"start","arguments":{"n":[1,"ü"]},"ok":false,'
        '"reason":"block_presence","feedback":"No."}],"finish":"stop","input_tokens":10,'
        '"output_tokens":5,"cost_usd":"0.000001","latency_s":1.0,"tries":1}]}'
    )


def test_an_external_agents_transcript_has_blanks_and_no_costs() -> None:
    call = ExternalCall(machine="main", tool="start", **REFUSED)
    transcript = Transcript([turn_of_call(0, call)])
    assert transcript.to_json(spaced=True).decode() == (
        '{"version": "1", "turns": [{"index": 0, "stage": "external", "sub_structure": "main", '
        '"role": "agent", "text": "", "actions": [{"name": "start", "arguments": {"n": [1, "ü"]}, '
        '"ok": false, "reason": "block_presence", "feedback": "No."}]}]}'
    )
    assert (transcript.actions, transcript.refusals) == (1, {"block_presence": 1})
