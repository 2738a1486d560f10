"""Models, prompt packs, workflows and tasks: what operators add, its versions, and wrong files."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend.agents.workbench import bench_of, rebuild
from buildarena_backend.catalog.models import WatchedRegistry, load_registry
from buildarena_backend.catalog.prompt_packs import PromptPacks, builtin_folder, read_pack
from buildarena_backend.catalog.specs import JobSpec, SweepSpec
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.catalog.tracks import Track, default_track
from buildarena_backend.catalog.workflows import workflow_sources
from buildarena_backend.errors import (
    PermanentError,
    RefusedError,
    StartupError,
    SubmissionError,
    UnknownIdError,
)
from buildarena_backend.replays.from_turns import replay_of_turns
from buildarena_backend.trials.scoring import task_of
from buildarena_benchmark import TaskError, broken_constraint, builtin_tasks, parse_custom_task
from buildarena_benchmark.families.initial_machine import make_initial_machine
from buildarena_benchmark.tasks import task as task_module

OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")
REPAIR = builtin_tasks()["repair-1"]
SPEC = JobSpec(task="narrow-gap", model="builtin/idle")


def test_a_bad_file_of_models_or_workflow_is_named(tmp_path: Path) -> None:
    for text, says in [
        ("models: [", "is not valid YAML"),
        ("models:\n  - {name: a/b, provider: nobody, model: b}", "'nobody'; known are alibaba"),
        ("models:\n  - {name: b, provider: openai, model: b}", r"models\.0\.name"),
        ("modles: []", "modles"),
        ("providers:\n  own: {protocol: openai, base_url: /v1}", r"providers\.own\.base_url"),
    ]:
        file = tmp_path / "models.yaml"
        file.write_text(text)
        with pytest.raises(StartupError, match=says):
            load_registry(file)
    with pytest.raises(StartupError, match=r"none\.yaml"):
        load_registry(tmp_path / "none.yaml")
    for target in ("nowhere", "file.py", ":Class", "no/such/file.py:Class", "m:1"):
        with pytest.raises(StartupError, match="workflow 'mine'"):
            workflow_sources({"mine": target})


def test_a_changed_sentence_changes_the_packs_hash_and_the_track(tmp_path: Path) -> None:
    copy = tmp_path / "pack"
    shutil.copytree(builtin_folder() / "default", copy)
    pack = PromptPacks().load("default")
    assert read_pack(copy, name="mine").digest == pack.digest
    (copy / "planner.md").write_text("# Role: planner\n\nPlan well.")
    assert read_pack(copy, name="mine").digest != pack.digest
    names = {"workflow": "five-role", "simulator": "pybullet", "simulation_version": "2"}
    track = Track(**names, prompts=pack.name, prompts_digest=pack.digest, data_sheets=True)
    assert pack.digest[:8] in track.id
    varied = replace(track, one_shot=True, rounds=5, analyst=True)
    assert varied.id.startswith("five-role+one-shot+data-sheets+5-rounds-analyst/pybullet-")


def test_a_board_shows_the_standard_track_or_the_one_with_most_ended_jobs() -> None:
    for ended, shown in (
        ({}, None),
        ({"a": 900, "standard": 1}, "standard"),
        ({"a": 1, "b": 2}, "b"),
        ({"c": 2, "b": 2, "a": 1}, "b"),
    ):
        assert default_track(ended, "standard") == shown


def test_a_malformed_pack_is_named(tmp_path: Path) -> None:
    with pytest.raises(StartupError, match=r"planner\.md"):
        read_pack(tmp_path, name="empty")
    with pytest.raises(StartupError, match="no prompt pack 'x'; there are default"):
        PromptPacks().load("x")


def add(context, text: str) -> str:
    task = parse_custom_task(text, origin="task")
    context.tasks.add(task, text)
    return task.version


def test_the_newest_version_is_named_and_jobs_keep_theirs(context, submissions) -> None:
    old = add(context, EXAMPLE)
    first, _ = submissions.submit_job(SPEC)
    new = add(context, OTHER)
    second, is_new = submissions.submit_job(SPEC)
    assert (first.task_version, second.task_version, is_new) == (old, new, True)
    names = context.tasks.newest()
    assert list(names) == [*builtin_tasks(), "narrow-gap"]
    assert names["narrow-gap"].version == new
    fresh = TaskCatalog(context.store.tasks)
    for catalogue in (context.tasks, fresh):
        for version, mass, current in ((old, 200, False), (new, 300, True)):
            assert catalogue.exact("narrow-gap", version).scenario.cargo.final_mass == mass
            assert catalogue.find("narrow-gap", version).current is current
        assert catalogue.exact("narrow-gap", "0" * 12) is None
        assert catalogue.find("narrow-gap").current
    assert task_of(first, fresh).version == old
    with pytest.raises(UnknownIdError, match="nowhere"):
        context.tasks.find("nowhere")


def test_the_same_content_is_stored_once_and_a_title_alone_does_not_change(context) -> None:
    task = parse_custom_task(EXAMPLE, origin="task")
    assert context.tasks.add(task, EXAMPLE, owner=None)
    assert not context.tasks.add(task, EXAMPLE + "# again\n")
    assert len(context.store.tasks.versions("narrow-gap")) == 1
    text = EXAMPLE.replace("A bridge", "No bridge").replace("unit: mass units", "unit: kg")
    with pytest.raises(RefusedError, match="another title and indicator"):
        context.tasks.add(parse_custom_task(text, origin="task"), text)
    with pytest.raises(TaskError, match=r"task:1: name: support-1 is a built-in task"):
        parse_custom_task(EXAMPLE.replace("narrow-gap", "support-1"), origin="task")


def test_a_version_gone_or_of_another_scorer_is_a_fault(context, submissions, monkeypatch) -> None:
    old = add(context, EXAMPLE)
    job, _ = submissions.submit_job(SPEC)
    monkeypatch.setattr(task_module, "SCORER_VERSION", task_module.SCORER_VERSION + 1)
    updated = TaskCatalog(context.store.tasks)
    renewed = updated.newest()["narrow-gap"]
    assert renewed.version != old
    assert (
        updated.find("narrow-gap").task == updated.exact("narrow-gap", renewed.version) == renewed
    )
    assert len(context.store.tasks.versions("narrow-gap")) == 2
    with pytest.raises(PermanentError, match="submit it again"):
        task_of(job, updated)
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql("DELETE FROM tasks")
    with pytest.raises(PermanentError, match="submit it again"):
        task_of(job, TaskCatalog(context.store.tasks))


@pytest.mark.parametrize("document", ["name: broken\n", EXAMPLE])
def test_a_row_that_is_no_task_of_its_name_is_left_out(context, submissions, document) -> None:
    context.store.tasks.add(name="broken", version="0" * 12, document=document)
    assert list(context.tasks.newest()) == list(builtin_tasks())
    add(context, OTHER)
    with pytest.raises(SubmissionError) as caught:
        submissions.plan(SweepSpec(tasks=["narrow-gap", "broken"], models=["builtin/idle"]))
    (error,) = caught.value.issues
    assert error.path == "tasks[1]"
    assert {"narrow-gap", "support-1"} <= set(error.choices)
    with pytest.raises(UnknownIdError, match="broken"):
        context.tasks.find("broken")


def test_a_jobs_task_is_drawn_by_its_seed() -> None:
    catalogue = SimpleNamespace(exact=lambda *_: REPAIR)
    for seed in (0, 3, 2**53 - 1):
        job = SimpleNamespace(task=REPAIR.name, task_version=REPAIR.version, seed=seed)
        job.track_config = {"rounds": 1}
        assert task_of(job, catalogue) == REPAIR.with_seed(seed)
        machine = make_initial_machine(REPAIR.initial_machine, seed)
        assert broken_constraint(task_of(job, catalogue), machine) is None
        for protocol in ({"rounds": 2}, {"rounds": 1, "paper": True}):
            job.track_config = protocol
            assert task_of(job, catalogue).test_trials == 0, "rounds instead, or the paper's"


def test_calls_made_again_begin_with_the_same_machine() -> None:
    task = REPAIR.with_seed(6)
    bench = bench_of(task, data_sheets=True)
    blocks = make_initial_machine(REPAIR.initial_machine, 6).blocks.values()
    wheels = [block.id for block in blocks if block.module.spins]
    other = {"action": "spinning_forward", "new_key": "Alpha9"}
    calls = [
        bench.call("main", tool, {"block_id": wheel, **arguments})
        for tool, arguments in (("flip_spin", {}), ("change_control_key", other))
        for wheel in wheels
    ]
    assert [call.ok for call in calls].count(True) == 6
    assert rebuild(calls, task, data_sheets=True).submitted() == bench.submitted()
    told = ("arguments", "ok", "reason", "feedback")
    turns = [
        {
            "index": number,
            "stage": "external",
            "sub_structure": call.machine,
            "actions": [{"name": call.tool, **{each: getattr(call, each) for each in told}}],
        }
        for number, call in enumerate(calls)
    ]
    assert replay_of_turns(turns, task).machine == bench.submitted()
    assert replay_of_turns(turns).machine != bench.submitted()


def test_a_models_file_is_read_again_when_it_changes_and_never_half(tmp_path) -> None:
    file = tmp_path / "models.yaml"
    entry = "{name: own/%s, provider: own, model: m}"
    text = "providers:\n  own: {protocol: openai, timeout_s: 9}\nmodels:\n"
    file.write_text(f"{text}  - {entry % 'a'}\n")
    registry = WatchedRegistry(file)
    assert "own/a" in registry.models
    assert registry.provider_of(registry.models["own/a"]).timeout_s == 9
    file.write_text(f"{text}  - {entry % 'a'}\n  - {entry % 'second'}\n")
    assert "own/second" in registry.models
    file.write_text(f"{text}  - {{name: own/second, provider: nobody, model: m}}\n")
    assert {"own/a", "own/second"} <= registry.models.keys(), "the last file that could be used"
    file.unlink()
    assert "own/a" in registry.models
    with pytest.raises(StartupError, match="models file"):
        WatchedRegistry(file)
