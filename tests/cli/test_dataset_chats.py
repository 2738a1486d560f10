"""Chats of a dataset: the words that were read, and calls that build the job's machine."""

import json
from pathlib import Path

import httpx
import pyarrow.parquet as pq
import pytest
from support.clients.commands import printed
from support.stages import work

from buildarena_benchmark import builtin_tasks
from buildarena_cli.dataset.messages import chat
from buildarena_cli.dataset.replaying import parts_hash
from buildarena_environment import ASSEMBLY, MAIN, Workbench
from buildarena_geometry import Machine

BLOCK = "Small Wooden Block"
ARMS = [
    ("arm", "start", {}),
    ("arm", "attach_block_to", {"base_block": "1", "face": "A", "new_block": BLOCK}),
    ("arm", "attach_block_to", {"base_block": "1", "face": "A", "new_block": BLOCK}),
    ("body", "start", {}),
    (ASSEMBLY, "add_machine", {"machine_id": "arm"}),
]


def exported(url: str, out: Path, *words: str) -> list[dict]:
    printed(url, "export", "--dataset", "--out", str(out), *words)
    return pq.read_table(out / "jobs.parquet").to_pylist()


def sweep(url: str, task: str, *models: str) -> None:
    spec = {"tasks": [task], "models": models, "simulator": "mujoco", "seeds": [1]}
    httpx.post(f"{url}/v1/sweeps", json=spec).raise_for_status()


def machine_of(row: dict) -> Machine:
    """What the calls of a chat build, made one after the other on a workbench."""
    task = builtin_tasks()[row["task"]]
    bench = Workbench(task.constraints.catalogue, task=task)
    for message in row["messages"]:
        calls = message["tool_calls"] or ()
        if len(calls) > 1:  # of these nothing was done
            continue
        for call in calls:
            name = message["machine"] or (ASSEMBLY if bench.machines else MAIN)
            bench.act(name, call["function"]["name"], json.loads(call["function"]["arguments"]))
    return bench.submitted()


@pytest.mark.ci
@pytest.mark.parametrize(
    ("task", "models"),
    [("support-1", ["builtin/expert", "builtin/random"]), ("lift-3", ["builtin/expert"])],
)
def test_the_calls_of_experts_and_random_builders_build_their_machines(
    url, context, tmp_path, task, models
):
    sweep(url, task, *models)
    work(context)
    jobs = exported(url, tmp_path / "jobs")
    assert sorted(row["model"] for row in jobs) == models
    for row in jobs:
        assert parts_hash(machine_of(row).to_document()) == row["parts_sha256"], row["model"]


def test_the_calls_of_a_person_build_the_machine_of_several(url, context, tmp_path):
    with httpx.Client(base_url=url) as client:
        body = {"task": "lift-3", "agent": "ada", "seed": 1, "simulator": "mujoco", "kind": "human"}
        id_ = client.post("/v1/sessions", json=body).raise_for_status().json()["id"]
        for machine, tool, arguments in ARMS:
            call = {"machine": machine, "tool": tool, "arguments": arguments}
            client.post(f"/v1/sessions/{id_}/calls", json=call).raise_for_status()
        client.post(f"/v1/sessions/{id_}/submit").raise_for_status()
    work(context)
    (row,) = exported(url, tmp_path / "jobs")
    assert row["model"] == "human/ada"
    assert [m["machine"] for m in row["messages"] if m["tool_calls"]] == [name for name, *_ in ARMS]
    assert parts_hash(machine_of(row).to_document()) == row["parts_sha256"]
    assert row["messages"][0]["role"] == "user"


def test_a_chat_has_all_that_roles_were_told(url, context, tmp_path):
    sweep(url, "support-1", "builtin/expert")
    work(context)
    (row,) = exported(url, tmp_path / "jobs")
    prompts = httpx.get(f"{url}/v1/jobs/{row['job_id']}/prompts").json()["prompts"]
    told = [text for p in prompts for text in ([p["system"]] if p["system"] else []) + p["user"]]
    messages = row["messages"]
    assert [m["content"] for m in messages if m["role"] in ("system", "user")] == told
    assert len(told) > 4
    first: dict[str, str] = {}
    for message in messages:
        if message["role"] in ("system", "assistant"):
            first.setdefault(message["name"], message["role"])
    assert {"planner", "drafter", "builder"} <= first.keys()
    assert set(first.values()) == {"system"}


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_chats_go_through_a_file_of_json_lines(url, context, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    from datasets import load_dataset

    sweep(url, "support-1", "builtin/expert", "builtin/idle")
    work(context)
    jobs = exported(url, tmp_path / "jobs")
    cache = str(tmp_path / "cache")
    of_folder = load_dataset(str(tmp_path / "jobs"), split="train", cache_dir=cache)
    file = tmp_path / "chats.jsonl"
    of_folder.select_columns(["messages", "tools"]).to_json(file)
    chats = load_dataset("json", data_files=str(file), split="train", cache_dir=cache)
    assert [row["messages"] for row in chats] == [row["messages"] for row in jobs]
    defined = {tool["function"]["name"] for tool in json.loads(chats[0]["tools"])}
    assert {"start", "attach_block_to"} <= defined


def test_without_prompts_the_statement_comes_first():
    turn = {"index": 0, "role": "planner", "text": "a plan", "actions": []}
    prompts = [{"turn": 0, "system": "You plan.", "user": ["Build.", "Now."]}]
    assert [m["content"] for m in chat("Build.", [turn])] == ["Build.", "a plan"]
    told = chat("Build.", [turn], prompts)
    assert [(m["role"], m["name"]) for m in told] == [
        ("system", "planner"),
        ("user", "planner"),
        ("user", "planner"),
        ("assistant", "planner"),
    ]
