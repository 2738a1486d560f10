"""Tasks in Inspect: found by name, played by a scripted model, scored as elsewhere."""

import base64
import json
import threading

import anyio
import pytest
from inspect_ai import score
from inspect_ai.model import ModelOutput, get_model
from scripted_models import (
    EXPERTS,
    USAGE,
    answers,
    call,
    calls_in,
    expert,
    listed,
    only,
    task_in,
    tried,
)

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import TrialPool, UnknownChoiceError, tools_of_models
from buildarena_benchmark.scores import decided_length
from buildarena_geometry import Machine
from buildarena_inspect.errors import ChoiceError
from buildarena_inspect.log_artifacts import MACHINE, TRAJECTORY
from buildarena_inspect.scorers import indicator, machine_hash, success
from buildarena_inspect.solvers import MAX_IDLE_TURNS
from buildarena_inspect.task_factory import TASKS
from buildarena_simulation import read_trajectory

WOOD = {"base_block": 1, "face": "A", "new_block": "Small Wooden Block"}


@pytest.mark.nightly
@pytest.mark.timeout(1200)
def test_all_tasks_end_to_end_score_as_the_library_does(run) -> None:
    log = run("buildarena/all", task_args={"simulator": "mujoco"})
    assert log.status == "success"
    assert [sample.id for sample in log.samples] == sorted(builtin_tasks())
    for sample in log.samples:
        trial = tried(sample.id, "mujoco")
        metadata = sample.scores["success"].metadata
        assert sample.scores["success"].value == "C", sample.id
        assert sample.scores["indicator"].value == trial.score.indicator
        assert (metadata["success"], metadata["flags"]) == (True, list(trial.score.flags))
        assert metadata["metrics"] == dict(trial.score.metrics)
        assert metadata["task_version"] == builtin_tasks()[sample.id].version
    figures = {
        name: metric.value for score in log.results.scores for name, metric in score.metrics.items()
    }
    assert figures["accuracy"] == 1.0
    # Wilson's lower bound where all n succeed: n / (n + z²) with z = 1.96.
    count = len(log.samples)
    assert figures["wilson_low"] == pytest.approx(count / (count + 1.96**2), abs=1e-4)
    assert figures["mean_rank"] == 1.5
    load = tried("support-1", "mujoco").score.indicator
    assert figures["support-1 load (mass units)"] == pytest.approx(load, rel=0.02)
    assert "lift-1 thrust_to_weight" in figures
    assert not [name for name in figures if "(1)" in name]


def test_tools_are_those_of_everybody(run) -> None:
    sample = only(run("buildarena/support_1", listed(call("start", {}), call("submit", {}))))
    asked = next(event for event in sample.events if event.event == "model")
    seen = {tool.name: tool for tool in asked.tools}
    ours = {tool.name: tool for tool in tools_of_models(builtin_tasks()["support-1"])}
    assert list(seen) == list(ours)
    for name, tool in ours.items():
        shown = seen[name].parameters.model_dump(exclude_none=True)
        assert seen[name].description == tool.description
        assert shown["required"] == tool.parameters["required"]
        for argument, schema in tool.parameters["properties"].items():
            known = {"description": argument.replace("_", " "), **schema}
            assert shown["properties"][argument] == known


def test_what_the_log_keeps_of_a_sample_and_is_scored_again_from(run) -> None:
    log = run("buildarena/support_1")
    sample = only(log)
    machine = Machine.from_document(sample.store[MACHINE])
    assert machine_hash(machine) == sample.scores["success"].metadata["machine_hash"]
    trajectory = read_trajectory(base64.b64decode(sample.store[TRAJECTORY]))
    assert len(trajectory.time_s) == decided_length(builtin_tasks()["support-1"], trajectory)
    pictured = sample.messages[-1]
    assert pictured.content[1].image.startswith("data:image/png;base64,")
    assert all("image" not in str(event.input) for event in sample.events if event.event == "model")
    assert [len(answers(sample)), sample.model_usage["mockllm/model"].total_tokens] == [14, 140]
    again = only(score(log, [success(), indicator()], action="overwrite", display="none"))
    for name in ("success", "indicator"):
        assert again.scores[name].value == sample.scores[name].value
    assert again.scores["success"].metadata["machine_hash"] == machine_hash(machine)


def test_refused_and_nonsensical_calls_are_answers_and_the_building_goes_on(run) -> None:
    log = run(
        "buildarena/support_2",
        listed(
            call("submit", {}),
            call("start", {"machine": "main"}),
            call("attach_block_to", {**WOOD, "face": "Z"}),
            call("attach_block_to", {"base_block": ["1"], "face": {}}),
            call("fly", {"up": 1}),
            call("start", {"machine": "a name with blanks"}),
            call("get_block_details", {"block_id": "\x00" * 3}),
            call("attach_block_to", WOOD),
            call("submit", {}),
        ),
    )
    texts = answers(only(log))
    errors = [m.error for m in only(log).messages if m.role == "tool"]
    assert "build one, beginning with the tool 'start'" in errors[0].message
    assert texts[1].startswith("Started.")
    assert 'has no face "Z"' in texts[2]
    assert "B <West>" in texts[2]
    assert "validation errors" in errors[3].message
    assert "fly not found" in errors[4].message
    assert "1 to 40 letters" in texts[5]
    assert errors[2] is errors[5] is errors[7] is None
    assert texts[7].startswith("Attached.")
    assert only(log).scores["success"].value == "I"
    assert only(log).scores["success"].metadata["metrics"]["parts"] == 2


@pytest.mark.nightly
def test_one_who_only_talks_or_only_fails_comes_to_an_end(run) -> None:
    for answer in (ModelOutput.from_content("mockllm", "Well…"), call("fly", {})):
        sample = only(run("buildarena/support_1", listed(answer)))
        replies = [message for message in sample.messages if message.role == "assistant"]
        assert len(replies) == MAX_IDLE_TURNS
        metadata = sample.scores["success"].metadata
        assert (sample.scores["success"].value, metadata["reason"]) == ("I", "nothing_submitted")


@pytest.mark.nightly
def test_what_was_never_submitted_is_tried_in_the_end(run) -> None:
    sample = only(run("buildarena/support_1", message_limit=20))
    assert sample.limit.type == "message"
    assert sample.scores["success"].metadata["trials"] == 1
    assert sample.scores["success"].metadata["metrics"]["parts"] > 2


@pytest.mark.nightly
def test_rewards_and_seeds_are_task_arguments(run) -> None:
    weights = {"success": 1.0, "indicator": 0.5}
    args = {"rewards": json.dumps(weights), "seed": 3, "simulator": "mujoco"}
    sample = only(run("buildarena/support_1", task_args=args))
    assert sample.scores["reward"].metadata["weights"] == weights
    assert sample.scores["success"].metadata["seed"] == 3
    assert sample.scores["indicator"].value != tried("support-1", "mujoco").score.indicator


@pytest.mark.nightly
def test_epochs_and_samples_side_by_side_share_nothing(run) -> None:
    """Half of the epochs build something else; each is judged by its own machine."""
    kinds: dict[str, bool] = {}

    def answer(messages):
        whole = kinds.setdefault(messages[0].id, len(kinds) % 2 == 0)
        if not whole and calls_in(messages) >= 3:
            return call("submit", {})
        return expert(messages)

    log = run("buildarena/all", answer, epochs=4, sample_id=["support-1", "lift-1"], max_samples=8)
    assert len(log.samples) == 8
    assert sorted(kinds.values()) == [False] * 4 + [True] * 4
    for sample in log.samples:
        whole = sample.scores["success"].value == "C"
        made = len(EXPERTS[sample.id]["calls"]) if whole else 3
        # What fails is submitted once more for each test trial.
        submitted = 1 if whole else 1 + builtin_tasks()[sample.id].test_trials
        assert len(answers(sample)) == made + submitted
        indicator = sample.scores["indicator"].value
        assert (indicator == tried(sample.id).score.indicator) is whole
    assert sum(sample.scores["success"].value == "C" for sample in log.samples) == 4


@pytest.mark.nightly
def test_a_trial_does_not_hold_up_another_samples_requests(run, monkeypatch) -> None:
    usual = TrialPool.try_machine
    trying, asked = threading.Event(), threading.Event()

    def tries(self, task, *given, **named):
        if task.name == "lift-1":
            trying.set()
            assert asked.wait(30), "the other sample's model was not asked meanwhile"
        return usual(self, task, *given, **named)

    async def answer(messages, *_):
        if task_in(messages) == "support-1":
            await anyio.to_thread.run_sync(trying.wait, 30)
            asked.set()
        output = expert(messages)
        output.usage = USAGE
        return output

    monkeypatch.setattr(TrialPool, "try_machine", tries)
    model = get_model("mockllm/model", custom_outputs=answer, memoize=False)
    log = run("buildarena/all", model=model, sample_id=["lift-1", "support-1"], max_samples=2)
    assert [sample.scores["success"].value for sample in log.samples] == ["C", "C"]


def test_arguments_that_do_not_exist_are_refused_with_the_choices() -> None:
    for given, error, message in [
        ({"solver": "rect"}, ChoiceError, "valid solvers: react, roles"),
        ({"simulator": "bullet"}, UnknownChoiceError, "choose from pybullet, mujoco"),
        ({"rewards": "[1]"}, ChoiceError, "an object of weights"),
        ({"rewards": {"style": 1}}, UnknownChoiceError, "choose from success"),
        ({"rounds": 0}, ValueError, "rounds is 0"),
    ]:
        with pytest.raises(error, match=message):
            TASKS["support_1"](**given)
