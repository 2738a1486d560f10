"""Jobs as a dataset: what the `datasets` library loads is what the service keeps, row by row."""

import json
import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import httpx
import pyarrow.parquet as pq
import pytest
import yaml
from support.clients.commands import printed, run_cli
from support.clients.tenants import ADMIN, WITH_KEYS, new_tenant
from support.jobs import execute
from support.servers.live_api import changed, live_api
from support.stages import work

from buildarena_cli.dataset import writing
from buildarena_cli.dataset.card import card
from buildarena_cli.dataset.columns import ACTIONS, JOBS
from buildarena_cli.dataset.counts import Counts
from buildarena_cli.dataset.messages import tools
from buildarena_cli.dataset.reading import Fetched
from buildarena_cli.dataset.replaying import parts_hash
from buildarena_cli.defaults import KEY_VARIABLE
from buildarena_cli.errors import CommandError
from buildarena_geometry import Machine
from buildarena_geometry import replay as done_again
from buildarena_geometry.machine_files import machine_bytes

MODELS = ["builtin/expert", "builtin/random", "builtin/idle"]
SWEEP = {"tasks": ["support-1"], "models": MODELS, "simulator": "mujoco", "seeds": [0]}
CALLS = [
    ("start", {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}),
    ("attach_block_to", {"base_block": 1, "face": "A", "new_block": "Small Wooden Block"}),
    ("attach_block_to", {"base_block": 1, "face": "A", "new_block": "Small Wooden Block"}),
]


@pytest.fixture(autouse=True)
def offline(tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HUB_DISABLE_TELEMETRY", "1")


def submitted(url: str, **more) -> str:
    answer = httpx.post(f"{url}/v1/sweeps", json={**SWEEP, **more}).raise_for_status()
    return str(answer.json()["id"])


def play(url: str, calls=CALLS, agent: str = "carpenter", **headers: str) -> str:
    """An agent's session of some calls, handed in."""
    with httpx.Client(base_url=url, headers=headers) as client:
        body = {"task": "support-1", "agent": agent, "seed": 0, "simulator": "mujoco"}
        id_ = client.post("/v1/sessions", json=body).raise_for_status().json()["id"]
        for tool, arguments in calls:
            call = {"tool": tool, "arguments": arguments}
            client.post(f"/v1/sessions/{id_}/calls", json=call).raise_for_status()
        client.post(f"/v1/sessions/{id_}/submit").raise_for_status()
    return str(id_)


def rows(folder: Path, table: str = "jobs") -> list[dict]:
    return pq.read_table(folder / f"{table}.parquet").to_pylist()


def loaded(folder: Path, *words: str, **options):
    from datasets import load_dataset

    cache = str(folder.parent / "cache")
    return load_dataset(*words, split="train", cache_dir=cache, **options)


def names(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


def called(messages: list[dict]) -> list[tuple[str, dict]]:
    calls = [call for message in messages for call in message["tool_calls"] or ()]
    return [(call["function"]["name"], json.loads(call["function"]["arguments"])) for call in calls]


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_sweep_loads_and_every_machine_is_found_again(url, context, tmp_path):
    submitted(url)
    session = play(url)
    work(context)
    out = tmp_path / "jobs"
    assert "4 jobs (1 succeeded)" in printed(url, "export", "--dataset", "--out", str(out))

    of_file = loaded(out, "parquet", data_files=str(out / "jobs.parquet"))
    of_folder = loaded(out, str(out))
    assert of_folder.to_list() == of_file.to_list()
    assert of_file.column_names == [column.name for column in JOBS]
    actions = loaded(out, str(out), "actions")
    assert actions.column_names == [column.name for column in ACTIONS]

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
        assert row["actions"] == sum(
            action["job_id"] == row["job_id"] and action["turn"] is not None for action in actions
        )
        if row["machine"] is not None:
            assert sha256(row["machine"].encode()).hexdigest() == row["machine_sha256"]
            machine = Machine.from_document(json.loads(row["machine"]))
            assert done_again(machine.log) == machine
            assert row["replayed_sha256"] == row["parts_sha256"]
    assert by_model["builtin/idle"]["machine"] is None
    assert by_model["builtin/idle"]["reason"] == "plan_unreadable"
    assert by_model["builtin/expert"]["license"] == "apache-2.0"
    assert by_model["agent/carpenter"]["license"] == "unknown"
    assert by_model["agent/carpenter"]["job_id"] == session


def test_the_calls_of_the_messages_build_the_machine(url, context, tmp_path):
    submitted(url, models=["builtin/expert"])
    play(url)
    work(context)
    printed(url, "export", "--dataset", "--out", str(tmp_path / "jobs"))
    by_model = {row["model"]: row for row in rows(tmp_path / "jobs")}

    agent = by_model["agent/carpenter"]
    machine = Machine()
    outcomes = [machine.act(*call) for call in called(agent["messages"])]
    assert [outcome.text for outcome in outcomes] == [
        message["content"] for message in agent["messages"] if message["role"] == "tool"
    ]
    # An agent's calls are all that the machine's log holds, so the whole document is the same.
    assert sha256(machine_bytes(machine)).hexdigest() == agent["machine_sha256"]

    expert, machine = by_model["builtin/expert"], Machine()
    for call in called(expert["messages"]):
        assert machine.act(*call).ok
    # What the workflow looked up is in the log as well.
    assert parts_hash(machine.to_document()) == expert["parts_sha256"]


def test_a_chat_has_the_form_that_training_libraries_take(url, context, tmp_path):
    play(url)
    work(context)
    printed(url, "export", "--dataset", "--out", str(tmp_path / "jobs"))
    (row,) = rows(tmp_path / "jobs")
    first, *others = row["messages"]
    session = httpx.get(f"{url}/v1/tasks/support-1").json()
    assert first["role"] == "user"
    assert session["statement"].strip() in first["content"]
    assert "add_control_sequence" in first["content"] or "`start`" in first["content"]
    for asked, answered in zip(others[::2], others[1::2], strict=True):
        (call,) = asked["tool_calls"]
        assert (asked["role"], asked["name"], call["type"]) == ("assistant", "agent", "function")
        assert (answered["role"], answered["tool_call_id"]) == ("tool", call["id"])
        assert answered["name"] == call["function"]["name"]
    defined = {tool["function"]["name"] for tool in json.loads(row["tools"])}
    assert defined >= {name for name, _ in called(row["messages"])}
    refused = [action for action in rows(tmp_path / "jobs", "actions") if not action["accepted"]]
    assert [(a["index"], a["turn"], a["refusal"]) for a in refused] == [(2, 2, "face_occupied")]
    assert refused[0]["feedback"] == others[-1]["content"]


@pytest.mark.parametrize("task", ["transport-1", "lift-1"])
def test_a_program_of_key_presses_is_done_again_too(url, context, tmp_path, task):
    submitted(url, tasks=[task], models=["builtin/expert"])
    work(context)
    printed(url, "export", "--dataset", "--out", str(tmp_path / "jobs"))
    (row,) = rows(tmp_path / "jobs")
    document = json.loads(row["machine"])
    assert row["replayed_sha256"] == row["parts_sha256"] == parts_hash(document)
    programmed = [a for a in rows(tmp_path / "jobs", "actions") if a["role"] == "session"]
    assert bool(programmed) == bool(document["control_sequence"])


def test_the_same_jobs_are_the_same_bytes(url, context, tmp_path):
    submitted(url)
    work(context)
    for place in ("one", "two"):
        printed(url, "export", "--dataset", "--out", str(tmp_path / place))
    assert names(tmp_path / "one") == {"README.md", "jobs.parquet", "actions.parquet"}
    for name in names(tmp_path / "one"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@pytest.mark.ci
def test_filters_take_what_they_say(url, context, tmp_path):
    first = submitted(url, models=["builtin/expert", "builtin/idle"])
    second = submitted(url, models=["builtin/idle"], tasks=["support-1", "lift-1"], name="other")
    work(context)
    chosen = {
        (): 3,
        ("--sweep", first): 2,
        ("--sweep", first, "--sweep", second): 3,
        ("--model", "builtin/idle"): 2,
        ("--model", "builtin/idle", "--model", "builtin/expert"): 3,
        ("--task", "support-1"): 2,
        ("--task", "support-1", "--sweep", second): 1,
        ("--success-only",): 1,
    }
    for number, (words, count) in enumerate(chosen.items()):
        out = tmp_path / str(number)
        printed(url, "export", "--dataset", "--out", str(out), *words)
        assert len(rows(out)) == count, words
    assert {row["model"] for row in rows(tmp_path / "7")} == {"builtin/expert"}


def test_disqualified_jobs_say_so(url, context, tmp_path):
    id_ = play(url)
    work(context)
    execute(context, "UPDATE jobs SET flags = '[\"unstable\"]' WHERE id = :id", {"id": id_})
    printed(url, "export", "--dataset", "--out", str(tmp_path / "all"))
    assert rows(tmp_path / "all")[0]["disqualified"]


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (["--model", "builtin/exprt"], (1, "builtin/expert")),
        (["--task", "support-9"], (1, "support-1")),
        (["--sweep", "sweep_00"], (1, "no sweep's id begins with")),
        (["--sweep", "../x"], (1, "is not the id of a sweep")),
        (["--track", "none/such"], (1, "none/such")),
        (["--license", "appache-2.0"], (2, "did you mean apache-2.0")),
    ],
)
def test_nonsense_is_refused_and_leaves_nothing(url, context, tmp_path, words, refusal):
    submitted(url, models=["builtin/idle"])
    work(context)
    done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / "out"), *words)
    code, message = refusal
    assert done.returncode == code
    assert message in done.stderr
    assert not [name for name in names(tmp_path) if "out" in name]


def test_options_of_datasets_are_no_options_of_boards(tmp_path, subtests):
    for words in [["--sweep", "sweep_00"], ["--success-only"], ["--license", "mit"]]:
        with subtests.test(words=words):
            done = run_cli(
                "http://127.0.0.1:1", "export", "--out", str(tmp_path / "board.csv"), *words
            )
            assert (done.returncode, done.stderr) == (2, f"{words[0]} goes with --dataset only")


def test_a_folder_with_something_in_it_stays_as_it_is(url, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    done = run_cli(url, "export", "--dataset", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "is not empty (" in done.stderr
    done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / "thesis.tex"))
    assert "is a file" in done.stderr
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_broken_export_leaves_nothing(url, context, tmp_path, monkeypatch):
    submitted(url)
    work(context)
    (tmp_path / "out").mkdir()

    def broken(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing, "card", broken)
    done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / "out"))
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert names(tmp_path / "out") == set()
    assert not [name for name in names(tmp_path) if name.endswith(".partial")]


def test_a_damaged_machine_is_no_row(url, context, tmp_path, monkeypatch):
    play(url)
    work(context)
    from buildarena_cli.dataset import reading

    real = reading.ask

    def damaged(client, path, **more):
        answer = real(client, path, **more)
        return answer.replace(b"Wooden", b"wooden") if path.endswith("/machine") else answer

    monkeypatch.setattr(reading, "ask", damaged)
    done = run_cli(url, "export", "--dataset", "--out", str(tmp_path / "out"))
    assert "arrived damaged" in done.stderr
    assert not (tmp_path / "out").exists()


def test_readers_export_others_jobs_and_no_key_stands_in_them(context, tmp_path, monkeypatch):
    out = tmp_path / "out"
    with changed(context, **WITH_KEYS) as own, live_api(own) as url:
        with httpx.Client(base_url=url) as client:
            owner, reader = new_tenant(client, "owner"), new_tenant(client, "reader", "read")
        play(url, Authorization=f"Bearer {owner.secret}")
        work(context)
        nobody = run_cli(url, "export", "--dataset", "--out", str(out))
        assert nobody.returncode == 1
        assert "set BUILDARENA_KEY" in nobody.stderr
        assert not out.exists()
        monkeypatch.setenv(KEY_VARIABLE, reader.secret)
        printed(url, "export", "--dataset", "--out", str(out))
    told = json.dumps([rows(out), rows(out, "actions")], default=str)
    told += (out / "README.md").read_text()
    assert "carpenter" in told
    for secret in (owner.secret, reader.secret, ADMIN, str(owner.id), str(reader.id), url):
        assert secret not in told


def test_the_card_says_what_is_there(url, context, tmp_path):
    submitted(url, models=["builtin/expert"])
    play(url, agent="me_and_you")
    work(context)
    out = tmp_path / "jobs"
    printed(url, "export", "--dataset", "--out", str(out), "--license", "CC-BY-4.0")
    _, front, text = (out / "README.md").read_text().split("---\n", 2)
    facts = yaml.safe_load(front)
    assert facts["license"] == ["apache-2.0", "cc-by-4.0"]
    assert facts["size_categories"] == ["n<1K"]
    assert {c["config_name"] for c in facts["configs"]} == {"jobs", "actions"}
    assert "This dataset has 2 jobs" in text
    for column in (*JOBS, *ACTIONS):
        assert f"| `{column.name}` | " in text
        assert column.meaning in text
    assert "| support-1 | agent/me_and_you | 1 |" in text
    # The blocks are run as they stand.
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 3
    scope: dict = {}
    for block in blocks:
        exec(block.replace('"FOLDER"', f"{str(out)!r}"), scope)
    assert scope["good"].num_rows == 1
    assert scope["row"]["machine_sha256"]


def made_up(number: int) -> Fetched:
    tokens = ("input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens")
    unknown = ("reason", "indicator", "flags", "metrics", "refusals", "manifest")
    job = {
        "id": f"job_{number:020x}",
        "task": "support-1",
        "task_version": "0" * 12,
        "model": "acme/one",
        "configuration": "0",
        "track": "five-role/mujoco-3/default-0-2",
        "seed": number,
        "outcome": "construction_failed",
        "success": False,
        "censored": False,
        "actions": 0,
        "refused_actions": 0,
        "usage": dict.fromkeys(("requests", *tokens, "cost_usd")),
        "artifacts": {},
        **dict.fromkeys((*unknown, "verified_at", "finished_at")),
    }
    turn = {"index": 0, "stage": "plan", "role": "planner", "text": "x" * 100_000, "actions": []}
    transcript = json.dumps({"version": "1", "turns": [turn]}).encode()
    return Fetched(job=job, task=None, machine=None, transcript=transcript)


def test_rows_are_written_as_they_come(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "GROUP_BYTES", 1_000_000)
    held: list[int] = []
    add = writing.Table.add

    def counted(table, row):
        add(table, row)
        held.append(len(table._rows))

    monkeypatch.setattr(writing.Table, "add", counted)
    counts = writing.write_dataset(map(made_up, range(50)), tmp_path / "out", licence="mit")
    assert counts.jobs == 50
    assert max(held) < 10
    file = pq.ParquetFile(tmp_path / "out" / "jobs.parquet")
    assert file.num_row_groups >= 5
    assert [row["seed"] for row in file.read().to_pylist()] == list(range(50))


def test_half_a_letter_is_replaced_and_a_broken_transcript_is_named(tmp_path):
    one = made_up(1)
    half = {"index": 0, "stage": "plan", "role": "planner", "text": "a\ud800b", "actions": []}
    spelled = json.dumps({"turns": [half]}).encode()
    assert b"\\ud800" in spelled
    writing.write_dataset([replace(one, transcript=spelled)], tmp_path / "half", licence="mit")
    assert [m["content"] for m in rows(tmp_path / "half")[0]["messages"]] == ["a\ufffdb"]
    for broken in (b"[]", b"{}", b'{"turns": [1]}', b"no JSON", b'{"turns": [{"text": 1}]}'):
        with pytest.raises(CommandError, match="job_00000000000000000001 has documents that can"):
            writing.write_dataset(
                [made_up(0), replace(one, transcript=broken)], tmp_path / "out", licence="mit"
            )
    assert names(tmp_path) == {"half"}


def test_an_interrupted_export_leaves_nothing(tmp_path):
    def stopped():
        yield made_up(0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        writing.write_dataset(stopped(), tmp_path / "out", licence="mit")
    assert names(tmp_path) == set()


def test_a_name_is_no_markup_in_the_card():
    counts = Counts(jobs=1)
    counts.cells["support-1", "agent/<img src=x>|[a](http://b)\n# c"] += 1
    counts.licences["mit"] += 1
    _, front, text = card(counts).split("---\n", 2)
    assert yaml.safe_load(front)["license"] == "mit"
    (line,) = [line for line in text.splitlines() if "img" in line]
    assert r"agent/\<img src=x\>\|\[a\](http:\//b) \# c | 1 |" in line


def test_tools_are_those_of_the_geometry_library():
    defined = [tool["function"] for tool in json.loads(tools())]
    assert {"start", "attach_block_to", "raise_objection"} <= {tool["name"] for tool in defined}
    assert all(tool["parameters"]["type"] == "object" for tool in defined)
