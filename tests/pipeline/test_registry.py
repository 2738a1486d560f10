from __future__ import annotations

from pathlib import Path

import pytest

from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.models import load_registry
from buildarena_pipeline.prompt_packs import load_pack, read_pack
from buildarena_pipeline.tracks import make_track

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
        "providers:\n  mine: {wire: openai, base_url: 'http://127.0.0.1:8000/v1'}\n"
        "models:\n  - {name: mine/llama, provider: mine, model: llama}\n"
    )
    registry = load_registry(file)
    entry = registry.models["mine/llama"]
    assert registry.provider_of(entry).base_url == "http://127.0.0.1:8000/v1"
    assert "builtin/expert" in registry.models


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("models: [", "is no YAML"),
        ("models:\n  - {name: a/b, provider: nobody, model: b}", "'nobody'; known are alibaba"),
        ("models:\n  - {name: b, provider: openai, model: b}", r"models\.0\.name"),
        ("modles: []", "modles"),
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "models.yaml"
    file.write_text(text)
    with pytest.raises(StartupError, match=says):
        load_registry(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(StartupError, match=r"none\.yaml"):
        load_registry(tmp_path / "none.yaml")


def test_a_changed_sentence_changes_the_packs_hash_and_the_track(tmp_path: Path) -> None:
    import shutil

    from buildarena_pipeline.prompt_packs import builtin_folder

    copy = tmp_path / "pack"
    shutil.copytree(builtin_folder() / "default", copy)
    original = load_pack("default").digest
    assert read_pack(copy, name="mine").digest == original
    (copy / "planner.md").write_text("# Role: planner\n\nPlan well.")
    assert read_pack(copy, name="mine").digest != original
    assert original[:8] in make_track("five-role", "pybullet", "default").id


def test_a_pack_that_lacks_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StartupError, match=r"planner\.md"):
        read_pack(tmp_path, name="empty")
    with pytest.raises(StartupError, match="no prompt pack 'x'; there are default"):
        load_pack("x")
