from __future__ import annotations

from pathlib import Path

import pytest

from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.prices import free_models
from buildarena_pipeline.catalog.prompt_packs import PromptPacks, read_pack
from buildarena_pipeline.catalog.specs import ClosedLoop
from buildarena_pipeline.catalog.tracks import make_track
from buildarena_pipeline.catalog.workflows import workflow_sources
from buildarena_pipeline.errors import StartupError

PAPER = {
    "grok4-0709",
    "gpt-4o",
    "gpt-5-2025-08-07",
    "claude-sonnet-4-20250514",
    "gemini-2.0-flash",
    "deepseek-chat",
    "doubao-seed-1-6-250615",
    "kimi-k2-turbo-preview",
    "qwen-plus",
    "qwen3.5-9b",
    "qwen3.5-27b",
    "ministral-14b",
}


def test_the_papers_snapshots_are_there() -> None:
    assert {entry.model for entry in load_registry().models.values()} >= PAPER


def test_an_operator_adds_models_and_providers(tmp_path: Path) -> None:
    file = tmp_path / "models.yaml"
    file.write_text(
        "providers:\n  mine: {protocol: openai, base_url: 'http://127.0.0.1:8000/v1'}\n"
        "models:\n  - {name: mine/llama, provider: mine, model: llama}\n"
    )
    registry = load_registry(file)
    entry = registry.models["mine/llama"]
    assert registry.provider_of(entry).base_url == "http://127.0.0.1:8000/v1"
    assert "builtin/expert" in registry.models


def test_a_bad_file_is_named(tmp_path: Path, subtests) -> None:
    for text, says in [
        ("models: [", "is not valid YAML"),
        ("models:\n  - {name: a/b, provider: nobody, model: b}", "'nobody'; known are alibaba"),
        ("models:\n  - {name: b, provider: openai, model: b}", r"models\.0\.name"),
        ("modles: []", "modles"),
    ]:
        with subtests.test(text=text):
            file = tmp_path / "models.yaml"
            file.write_text(text)
            with pytest.raises(StartupError, match=says):
                load_registry(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(StartupError, match=r"none\.yaml"):
        load_registry(tmp_path / "none.yaml")


def test_a_changed_sentence_changes_the_packs_hash_and_the_track(tmp_path: Path) -> None:
    import shutil

    from buildarena_pipeline.catalog.prompt_packs import builtin_folder

    copy = tmp_path / "pack"
    shutil.copytree(builtin_folder() / "default", copy)
    packs = PromptPacks()
    original = packs.load("default").digest
    assert read_pack(copy, name="mine").digest == original
    (copy / "planner.md").write_text("# Role: planner\n\nPlan well.")
    assert read_pack(copy, name="mine").digest != original
    five_role = workflow_sources({})["five-role"]
    plain = make_track(five_role, "pybullet", packs.load("default"), version="2")
    assert original[:8] in plain.id
    loop = ClosedLoop(rounds=5, analyst=True)
    varied = make_track(
        five_role, "pybullet", packs.load("default"), version="2", one_shot=True, closed_loop=loop
    )
    assert varied.id.startswith("five-role+one-shot+data-sheets+5-rounds-analyst/pybullet-")


def test_a_pack_that_lacks_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StartupError, match=r"planner\.md"):
        read_pack(tmp_path, name="empty")
    with pytest.raises(StartupError, match="no prompt pack 'x'; there are default"):
        PromptPacks().load("x")


PUBLISHED = """
agents:
  planner: {system_message: Plan it.}
  draft_reviewer: {system_message: Review it.}
controller: Drive it.
"""
LEVELS = """
category: support
level: soft
task: Carry it over.
---
category: lift
level: hard
task: Lift it.
"""


def test_a_pack_of_the_published_layout_takes_the_place_of_our_sentences(tmp_path: Path) -> None:
    folder = tmp_path / "packs" / "theirs"
    folder.mkdir(parents=True)
    (folder / "prompt.yaml").write_text(PUBLISHED)
    (folder / "levels.yaml").write_text(LEVELS)
    packs = PromptPacks(tmp_path / "packs")
    assert packs.names == ["default", "theirs"]
    pack = packs.load("theirs")
    assert pack.roles["planner"] == "Plan it."
    assert pack.roles["reviewer"] == "Review it."
    assert pack.roles["controller"] == "Drive it."
    assert pack.roles["builder"] == packs.load("default").roles["builder"]
    assert pack.statements == {"support-1": "Carry it over.", "lift-3": "Lift it."}
    assert pack.digest != packs.load("default").digest


def test_a_malformed_published_pack_is_named(tmp_path: Path, subtests) -> None:
    for file, text, says in [
        ("prompt.yaml", "agents: {planner: {}}", "system_message"),
        ("prompt.yaml", "agents: [", "can't be read"),
        ("levels.yaml", "category: x\nlevel: extreme\ntask: y", "document 1 .* soft, medium, hard"),
    ]:
        with subtests.test(file=file):
            (tmp_path / "prompt.yaml").write_text(PUBLISHED)
            (tmp_path / file).write_text(text)
            with pytest.raises(StartupError, match=says):
                read_pack(tmp_path, name="bad")


def test_a_bad_workflow_setting_is_named(subtests) -> None:
    for target in ["nowhere", "file.py", ":Class", "no/such/file.py:Class", "m:1"]:
        with subtests.test(target=target), pytest.raises(StartupError, match="workflow 'mine'"):
            workflow_sources({"mine": target})


def test_only_what_is_known_to_cost_nothing_is_free(tmp_path) -> None:
    file = tmp_path / "models.yaml"
    file.write_text(
        "providers:\n  own: {protocol: openai, base_url: 'http://127.0.0.1:9/v1'}\n"
        "models:\n"
        "  - {name: own/unpriced, provider: own, model: nobody-knows-it}\n"
        "  - {name: own/local, provider: own, model: local, price: {input: 0, output: 0}}\n"
        "  - {name: own/cached, provider: own, model: c, price: {input: 0, output: 0, cached: 1}}\n"
        "  - {name: own/dear, provider: own, model: dear, price: {input: 1, output: 0}}\n"
    )
    free = free_models(load_registry(file))
    assert {"own/local", "builtin/expert", "builtin/idle"} <= set(free)
    assert not {"own/unpriced", "own/cached", "own/dear"} & set(free)
