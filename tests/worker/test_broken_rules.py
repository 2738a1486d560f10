"""A result that another service let through in spite of the rules does not stand verification."""

from __future__ import annotations

from support.stages import work

from buildarena_pipeline.agents import submission
from buildarena_pipeline.agents.sessions import ExternalSessions
from buildarena_worker.wiring import verifier

ROCKET = (
    ("start", {}),
    ("attach_block_to", {"base_block": "1", "face": "A", "new_block": "Water Cannon"}),
    ("shift_block", {"block_id": "2", "shift_real": [0.5, 0, 0]}),
    ("shift_block", {"block_id": "2", "shift_real": [0.5, 0, 0]}),
)


def _submitted(context) -> str:
    sessions = ExternalSessions(context)
    job = sessions.open(task="lift-1", agent="me", seed=0, simulator="mujoco").job
    for tool, arguments in ROCKET:
        done = sessions.call(job.id, machine="main", tool=tool, arguments=arguments)
        assert done.ok, done.feedback
    sessions.submit(job.id)
    work(context)
    return job.id


def test_a_machine_that_was_let_through_fails_verification(context, monkeypatch) -> None:
    monkeypatch.setattr(submission, "broken_constraint", lambda *_: None)
    job = _submitted(context)
    assert context.store.jobs.get(job).outcome == "unsuccessful"
    report = verifier(context).verify(job).as_document()
    assert not report["ok"]
    wrong = [check for check in report["checks"] if not check["ok"]]
    assert [(check["name"], check["found"]) for check in wrong] == [("reason", "unjoined_parts")]


def test_a_machine_that_was_refused_is_verified_as_refused(context) -> None:
    job = _submitted(context)
    assert context.store.jobs.get(job).reason == "unjoined_parts"
    report = verifier(context).verify(job).as_document()
    assert report["ok"], [check for check in report["checks"] if not check["ok"]]
