"""Jobs as a dataset: what the `datasets` library loads is what the service keeps, row by row."""

import json
import re
from hashlib import sha256
from pathlib import Path

import httpx
import pyarrow.parquet as pq
import pytest
import yaml
from support.clients.commands import printed, run_cli
from support.clients.tenants import ADMIN, WITH_KEYS, new_tenant
from support.jobs import execute
from support.servers.live_api import live_api
from support.stages import work

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import ASSEMBLY, MAIN, Workbench
from buildarena_cli.dataset import reading, writing
from buildarena_cli.dataset.card import Counts, card
from buildarena_cli.dataset.columns import JOBS
from buildarena_client.config import KEY_VARIABLE
from buildarena_geometry import Machine
from buildarena_geometry import replay as done_again
from buildarena_geometry.machine_files import machine_bytes

MODELS = ["builtin/expert", "builtin/random", "builtin/idle"]
SWEEP = {"tasks": ["support-1"], "models": MODELS, "simulator": "mujoco", "seeds": [0]}
BLOCK = {"base_block": "1", "face": "A", "new_block": "Small Wooden Block"}
CALLS = [("main", "start", {}), *[("main", "attach_block_to", BLOCK)] * 2]
_ARM = [("arm", "start", {}), *[("arm", "attach_block_to", BLOCK)] * 2]
ARMS = [*_ARM, ("body", "start", {}), (ASSEMBLY, "add_machine", {"machine_id": "arm"})]


@pytest.fixture(autouse=True)
def offline(tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HUB_DISABLE_TELEMETRY", "1")


def submitted(url: str, **more) -> str:
    answer = httpx.post(f"{url}/v1/sweeps", json={**SWEEP, **more}).raise_for_status()
    return str(answer.json()["id"])


def play(url: str, calls=CALLS, agent="carpenter", key=None, **more: str) -> str:
    """An agent's session of some calls, handed in."""
    headers = {"Authorization": f"Bearer {key}"} if key else {}
    with httpx.Client(base_url=url, headers=headers) as client:
        body = {"task": "support-1", "agent": agent, "seed": 0, "simulator": "mujoco", **more}
        id_ = client.post("/v1/sessions", json=body).raise_for_status().json()["id"]
        for machine, tool, arguments in calls:
            call = {"machine": machine, "tool": tool, "arguments": arguments}
            client.post(f"/v1/sessions/{id_}/calls", json=call).raise_for_status()
        client.post(f"/v1/sessions/{id_}/submit").raise_for_status()
    return str(id_)


def export(url: str, out: Path, *words: str) -> list[dict]:
    printed(url, "export", "--dataset", "--out", str(out), *words)
    return rows(out)


def rows(folder: Path) -> list[dict]:
    return pq.read_table(folder / "jobs.parquet").to_pylist()


def names(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_sweep_loads_and_every_machine_is_found_again(url, context, tmp_path):
    from datasets import load_dataset

    def loaded(*words: str, **options):
        return load_dataset(*words, split="train", cache_dir=str(tmp_path / "cache"), **options)

    submitted(url)
    session = play(url)
    work(context)
    out = tmp_path / "jobs"
    assert "4 jobs (1 succeeded)" in printed(url, "export", "--dataset", "--out", str(out))
    of_file, of_folder = loaded("parquet", data_files=str(out / "jobs.parquet")), loaded(str(out))
    assert of_folder.to_list() == of_file.to_list()
    assert of_file.column_names == [column.name for column in JOBS]

    by_model = {row["model"]: row for row in of_file}
    assert set(by_model) == {*MODELS, "agent/carpenter"}
    for row in of_file:
        kept = httpx.get(f"{url}/v1/jobs/{row['job_id']}").json()
        assert row["machine_sha256"] == kept["artifacts"].get("machine")
        assert row["transcript_sha256"] == kept["artifacts"]["transcript"]
        assert row["trajectory_sha256"] == [
            digest for name, digest in kept["artifacts"].items() if name.startswith("trajectory-")
        ]
        assert (row["success"], row["indicator"]) == (kept["success"], kept["indicator"])
        asked = [len(message["tool_calls"] or ()) for message in row["messages"]]
        assert row["actions"] == sum(asked)
        if row["machine"] is not None:
            assert sha256(row["machine"].encode()).hexdigest() == row["machine_sha256"]
            machine = Machine.from_document(json.loads(row["machine"]))
            assert done_again(machine.log) == machine
    idle, agent = by_model["builtin/idle"], by_model["agent/carpenter"]
    assert (idle["machine"], idle["reason"]) == (None, "plan_unreadable")
    assert by_model["builtin/expert"]["license"] == "apache-2.0"
    assert (agent["license"], agent["job_id"]) == ("unknown", session)


# Chats: the words that were read, and calls that build the job's machine


def machine_of(row: dict) -> Machine:
    """What the calls of a chat build, made one after the other on a workbench."""
    task = builtin_tasks()[row["task"]]
    bench = Workbench(task.constraints.catalogue, task=task)
    for message in row["messages"]:
        calls = message["tool_calls"] or ()
        for call in calls if len(calls) == 1 else ():  # of several nothing was done
            name = message["machine"] or (ASSEMBLY if bench.machines else MAIN)
            bench.act(name, call["function"]["name"], json.loads(call["function"]["arguments"]))
    return bench.submitted()


def test_the_calls_of_the_messages_build_the_machine(url, context, tmp_path):
    submitted(url, models=["builtin/expert"])
    submitted(url, models=["builtin/expert"], tasks=["transport-1"], name="keys")
    play(url)
    play(url, ARMS, "ada", task="lift-3", kind="human")
    work(context)
    found = {(row["model"], row["task"]): row for row in export(url, tmp_path / "jobs")}
    for row in found.values():
        # A controller wrote key presses as text: no call of the chat made them.
        if row["task"] != "transport-1":
            assert machine_of(row) == Machine.from_document(json.loads(row["machine"]))
    # An agent's calls are all that the machine's log holds, so the whole document is the same.
    agent = found["agent/carpenter", "support-1"]
    assert sha256(machine_bytes(machine_of(agent))).hexdigest() == agent["machine_sha256"]
    arms = found["human/ada", "lift-3"]
    told = [m["machine"] for m in arms["messages"] if m["tool_calls"]]
    assert told == [name for name, *_ in ARMS]

    expert = found["builtin/expert", "support-1"]
    prompts = httpx.get(f"{url}/v1/jobs/{expert['job_id']}/prompts").json()["data"]
    told = [text for p in prompts for text in ([p["system"]] if p["system"] else []) + p["user"]]
    read = [m["content"] for m in expert["messages"] if m["role"] in ("system", "user")]
    assert read == told
    assert len(told) > 4

    first, *others = agent["messages"]
    assert first["role"] == "user"
    assert builtin_tasks()["support-1"].statement.strip() in first["content"]
    defined = {tool["function"]["name"] for tool in json.loads(agent["tools"])}
    for asked, answered in zip(others[::2], others[1::2], strict=True):
        (call,) = asked["tool_calls"]
        assert (asked["role"], asked["name"], call["type"]) == ("assistant", "agent", "function")
        assert (answered["role"], answered["tool_call_id"]) == ("tool", call["id"])
        assert answered["name"] == call["function"]["name"] in defined


# Which jobs


def test_filters_take_what_they_say_and_the_same_jobs_are_the_same_bytes(url, context, tmp_path):
    first = submitted(url, models=["builtin/expert", "builtin/idle"])
    second = submitted(url, models=["builtin/idle"], tasks=["support-1", "lift-1"], name="other")
    work(context)
    execute(context, "UPDATE jobs SET flags = '[\"unstable\"]' WHERE task = 'lift-1'")
    chosen = {(): 3, ("--sweep", first): 2, ("--sweep", first, "--sweep", second): 3}
    chosen |= {("--model", "builtin/idle"): 2, ("--success-only",): 1}
    chosen["--task", "support-1", "--sweep", second] = 1
    for number, (words, count) in enumerate(chosen.items()):
        found = export(url, tmp_path / str(number), *words)
        assert len(found) == count, words
        assert all(row["disqualified"] == (row["task"] == "lift-1") for row in found)
    export(url, tmp_path / "again")
    assert names(tmp_path / "again") == {"README.md", "jobs.parquet"}
    for name in names(tmp_path / "again"):
        assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_nonsense_is_refused_and_leaves_what_is_there_as_it_is(url, context, tmp_path, subtests):
    submitted(url, models=["builtin/idle"])
    work(context)
    (tmp_path / "full").mkdir()
    thesis = tmp_path / "full" / "thesis.tex"
    thesis.write_text("years of work")
    for out, words, code, message in (
        ("out", ["--model", "builtin/exprt"], 1, "builtin/expert"),
        ("out", ["--task", "support-9"], 1, "support-1"),
        ("out", ["--sweep", "sweep_0000000000"], 1, "no sweep's id begins with"),
        ("out", ["--sweep", "../x"], 1, "is not the id of a sweep"),
        ("out", ["--track", "none/such"], 1, "none/such"),
        ("full", [], 1, "is not empty ("),
        ("full/thesis.tex", [], 1, "is a file"),
    ):
        with subtests.test(message=message):
            done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / out), *words)
            assert (done.returncode, message in done.stderr) == (code, True), done.stderr
            assert not [name for name in names(tmp_path) if "out" in name]
    assert thesis.read_text() == "years of work"
    for words in (["--sweep", "sweep_00"], ["--success-only"], ["--license", "mit"]):
        board = run_cli("http://127.0.0.1:1", "export", "--out", str(tmp_path / "b.csv"), *words)
        assert (board.returncode, board.stderr) == (2, f"{words[0]} goes with --dataset only")


def test_a_broken_or_damaged_export_leaves_nothing(url, context, tmp_path, monkeypatch):
    play(url)
    work(context)
    (tmp_path / "out").mkdir()
    real = reading.fetch

    def broken(*_args, **_options):
        raise OSError(28, "No space left on device")

    def damaged(client, path, **more):
        answer = real(client, path, **more)
        return answer.replace(b"Wooden", b"wooden") if path.endswith("/machine") else answer

    for module, name, fault, says in (
        (writing, "card", broken, "No space left on device"),
        (reading, "fetch", damaged, "arrived damaged"),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(module, name, fault)
            done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / "out"))
        assert (done.returncode, says in done.stderr) == (1, True)
        assert names(tmp_path / "out") == set()
        assert not [name for name in names(tmp_path) if name.endswith(".partial")]


def test_readers_export_others_jobs_and_no_key_stands_in_them(context, tmp_path, monkeypatch):
    out = tmp_path / "out"
    with live_api(context, **WITH_KEYS) as url:
        with httpx.Client(base_url=url) as client:
            owner, reader = new_tenant(client, "owner"), new_tenant(client, "reader", "read")
        play(url, key=owner.secret)
        work(context)
        nobody = run_cli(url, "export", "--dataset", "--out", str(out))
        assert (nobody.returncode, "set BUILDARENA_KEY" in nobody.stderr) == (1, True)
        assert not out.exists()
        monkeypatch.setenv(KEY_VARIABLE, reader.secret)
        export(url, out)
    told = json.dumps(rows(out), default=str)
    told += (out / "README.md").read_text()
    assert "carpenter" in told
    for secret in (owner.secret, reader.secret, ADMIN, str(owner.id), str(reader.id), url):
        assert secret not in told


def test_the_card_says_what_is_there_and_its_blocks_run(url, context, tmp_path):
    submitted(url, models=["builtin/expert"])
    play(url, agent="me_and_you")
    work(context)
    out = tmp_path / "jobs"
    export(url, out, "--license", "CC-BY-4.0")
    _, front, text = (out / "README.md").read_text().split("---\n", 2)
    facts = yaml.safe_load(front)
    assert facts["license"] == ["apache-2.0", "cc-by-4.0"]
    assert {c["config_name"] for c in facts["configs"]} == {"jobs"}
    assert "This dataset has 2 jobs" in text
    assert [c.name for c in JOBS if f"| `{c.name}` | " not in text] == []
    assert "| support-1 | agent/me_and_you | 1 |" in text
    scope: dict = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(block.replace('"FOLDER"', f"{str(out)!r}"), scope)
    assert scope["good"].num_rows == 1
    assert scope["row"]["machine_sha256"]


def test_a_name_is_no_markup_in_the_card():
    counts = Counts(jobs=1)
    counts.cells["support-1", "agent/<img src=x>|[a](http://b)\n# c"] += 1
    counts.licences["mit"] += 1
    (line,) = [line for line in card(counts).splitlines() if "img" in line]
    assert r"agent/\<img src=x\>\|\[a\](http:\//b) \# c | 1 |" in line
