"""The controller of a workflow may write a program where its task offers senses."""

import json

import pytest
from support.machines.piloted import experts_machine
from support.player import Player
from support.servers.live_api import changed
from support.stages import work

from buildarena_backend.catalog.models import load_registry
from buildarena_backend.catalog.specs import JobSpec, SweepSpec
from buildarena_backend.errors import SubmissionError
from buildarena_backend.submission.submission import Submissions
from buildarena_benchmark import builtin_tasks
from buildarena_simulation import simulate
from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.workflow.control import (
    MAX_ANSWERS,
    MAX_SENSES,
    PROGRAM_TURNS,
    format_piloting,
)

TASK = "landing-2"
FALLS = "function control() return {} end"
_FLY = {"control_config": [{"block": "4", "action": "fly", "keys": ["Alpha1"]}]}
_FLY["control_sequence"] = [{"time": 1.0, "key": "Alpha1", "hold_for": 1.0}]
KEYS = json.dumps({"control_design": "Push.", **_FLY})


def fenced(program: str, before: str = "", after: str = "") -> str:
    return f"{before}```lua\n{program}\n```{after}"


class Answering:
    """The expert, whose controller gives some answers in turn, the last one forever."""

    def __init__(self, *answers: str) -> None:
        self._otherwise, self.answers = BuiltinClient("expert").complete, list(answers)
        self.read: list[str] = []

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        if not request.messages[0].text.startswith("# Role: controller"):
            return self._otherwise(request)
        self.read.append(request.messages[-1].text)
        kept = self.answers if len(self.answers) == 1 else [self.answers.pop(0)]
        return Completion(text=kept[0])


def answered(*answers: str, task: str = TASK):
    model = Answering(*answers)
    return Player()(task=task, client=model, workflow="builder"), model


def test_the_expert_writes_programs_in_every_workflow(play) -> None:
    for workflow in ("five-role", "guidance-builder", "builder"):
        played = play(task=TASK, workflow=workflow, seed=3)
        assert played.suspended, played.failure
        assert played.suspended.controls is None
        assert "function control(t, sense)" in played.suspended.machine.controller


def test_a_controller_reads_the_contract_and_what_its_task_offers() -> None:
    _, model = answered(fenced(FALLS))
    told = model.read[0]
    assert "## Program" in told
    for words in ("control(t, sense)", "sense.marks[name]", "place 0.05", "0.04 s old"):
        assert words in told, words
    assert "sense.gates" not in told
    _, model = answered(KEYS, task="flight-3")
    assert "## Program" not in model.read[0]


def test_the_last_program_of_an_answer_counts(subtests) -> None:
    for answer in [
        fenced(FALLS),
        fenced(FALLS, "It falls.\n", "\nThat is all."),
        f"```Lua\n{FALLS}\n```",
        fenced("function control() return 1 end", "No, not this:\n", "\nbut this:\n")
        + "\n"
        + fenced(FALLS),
        f"  ```lua\n{FALLS}\n  ```",
    ]:
        with subtests.test(answer=answer):
            played, _ = answered(answer)
            assert played.suspended, played.failure
            assert played.suspended.machine.controller.strip() == FALLS


def test_an_answer_of_a_hundred_thousand_beginnings_is_read() -> None:
    """Each is looked at once: a search for the end of each would not end in a day."""
    played, _ = answered("```lua\n" * 100_000 + FALLS, fenced(FALLS))
    assert played.suspended, played.failure


def test_keys_are_an_answer_too() -> None:
    played, _ = answered(KEYS)
    assert played.suspended.machine.controller == ""
    assert [press.key for press in played.suspended.controls] == ["Alpha1"]


def test_a_program_that_cannot_be_read_costs_a_turn_and_no_trial(subtests) -> None:
    for answer, told in [
        (fenced("function control( return {} end"), "line 1"),
        (fenced("x = 1"), "control"),
        (fenced("while true do end"), "instructions"),
        (fenced("error('stop')"), "stop"),
        (fenced("-- " + "x" * 70_000), "65,536"),
        (fenced(""), "control"),
        ("function control() return end", "no JSON object; a program stands between"),
        (f"```\n{FALLS}\n```", "between a line of ```lua and"),
    ]:
        with subtests.test(answer=answer):
            played, model = answered(answer, fenced(FALLS))
            assert played.suspended, played.failure
            assert len(model.read) == 2
            assert told in model.read[1]
            assert "No trial was run." in model.read[1]


def test_who_never_writes_one_that_can_be_read_has_not_built() -> None:
    played, model = answered(fenced("function control("))
    assert len(model.read) == PROGRAM_TURNS
    assert played.failure.reason == "control_invalid"


def test_a_program_is_no_answer_where_keys_alone_count() -> None:
    played, model = answered(fenced(FALLS), KEYS.replace('"4"', '"2"'), task="flight-3")
    assert len(model.read) >= 2
    assert "Your answer cannot be used: " in model.read[1]
    assert "```lua" not in model.read[1]
    assert played.suspended is None or played.suspended.machine.controller == ""


def test_a_failing_program_is_told_in_its_own_words(context, submissions, monkeypatch) -> None:
    """Each of its three trials ends at the program's line; the job has the sentence."""
    model = Answering(fenced("function control(t) return t > 1 and nothing.here or {} end"))
    monkeypatch.setattr(BuiltinClient, "complete", model.complete)
    spec = JobSpec(task=TASK, model="builtin/expert", workflow="builder", worlds=2)
    job, _ = submissions.submit_job(spec)
    work(context)
    job = context.store.jobs.get(job.id)
    assert (job.outcome, job.indicator) == ("unsuccessful", 0.0)
    assert "worlds" not in (job.metrics or {})
    assert "line 1, tick 26" in job.manifest["simulator"]["refused"]
    assert any("line 1, tick 26" in text for text in model.read[1:])


def test_a_job_of_no_world_is_refused_where_worlds_decide(context, subtests) -> None:
    with changed(context, besiege_game="1.0", besiege_mod="1.0", worlds=4) as own:
        submissions = Submissions(own, load_registry())
        spec = {"tasks": ["lift-1", TASK], "models": ["builtin/idle"], "samples": 1}
        for asked in [{"worlds": 0}, {"simulator": "besiege"}]:
            with subtests.test(asked=asked):
                with pytest.raises(SubmissionError) as caught:
                    submissions.plan(SweepSpec(**spec, **asked))
                (issue,) = caught.value.issues
                assert issue.path == "tasks[1]"
                assert "ask for `worlds` of 1 or more" in issue.message
                assert "mujoco" in issue.message


@pytest.mark.ci
def test_a_table_tells_what_a_program_sensed_and_asked_for() -> None:
    task = builtin_tasks()[TASK]
    machine = experts_machine(task)
    piloting = simulate(machine, task.scenario, "mujoco").piloting
    head, *rows = format_piloting(piloting, machine.controller).splitlines()
    columns = head.split(", ")
    assert columns[0] == "t"
    assert {"position.z", "velocity.z", "body_spin.x", "marks.goal.relative.y"} <= set(columns)
    assert set(columns) >= set(piloting.action_names)
    assert len(columns) <= 1 + MAX_SENSES + MAX_ANSWERS
    assert [row.split(", ")[0] for row in rows[:4]] == ["0", "0.48", "1", "1.52"]
    assert len({len(row.split(", ")) for row in (head, *rows)}) == 1
    assert len(rows) == 2 * task.scenario.duration_s
    blind = format_piloting(piloting, "function control(t) return {} end")
    assert blind.splitlines()[0].split(", ") == ["t", *piloting.action_names]
