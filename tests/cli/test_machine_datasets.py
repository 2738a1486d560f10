"""Datasets of machines: the same from the same seed, resumed, and nothing in them goes unseen."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from support.clients.commands import run

from buildarena_benchmark import CANARY, builtin_tasks, paper_tasks
from buildarena_cli.dataset.columns import MACHINES, schema
from buildarena_cli.dataset.machines import drawing, making
from buildarena_cli.dataset.machines.drawing import (
    MAKERS,
    VARIANTS,
    cycle_of,
    design_hash,
    drawable_tasks,
)
from buildarena_cli.dataset.machines.journal import Journal
from buildarena_cli.dataset.machines.making import Plan
from buildarena_cli.dataset.machines.trying import SPLITS, split_of
from buildarena_environment import Environment
from buildarena_environment.variation.genome import Genome

pytestmark = pytest.mark.nightly

TASKS = ("support-1", "throw-1", "lift-1")
COUNT = 24
WORDS = ("--count", str(COUNT), "--seed", "3", *(w for task in TASKS for w in ("--task", task)))


def make(out: Path, *words: str):
    return run("dataset", "machines", "--out", str(out), *WORDS, *(words or ("--processes", "1")))


def rows(folder: Path) -> list[dict]:
    found = [row for file in folder.glob("*.parquet") for row in pq.read_table(file).to_pylist()]
    return sorted(found, key=lambda row: row["number"])


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("machines") / "one"
    done = make(out)
    assert done.returncode == 0, done.stderr
    assert f"{COUNT} machines (" in done.stdout
    return out


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_it_loads_with_its_splits_and_no_two_machines_are_alike(made, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    from datasets import load_dataset

    loaded = load_dataset(str(made), cache_dir=str(tmp_path))
    assert set(loaded) == set(SPLITS)
    every = [row for split in loaded.values() for row in split]
    assert sorted(row["number"] for row in every) == list(range(COUNT))
    assert len({row["parts_sha256"] for row in every}) == COUNT
    for row in every:
        assert set(row) == {column.name for column in MACHINES}
        assert row["canary"] == CANARY
        assert row["task_version"] == builtin_tasks()[row["task"]].version
        assert row["id"] == row["parts_sha256"][: len(row["id"])]
    assert {row["outcome"] for row in every} == {"success", "unsuccessful"}
    assert {row["maker"] for row in every} == set(MAKERS)
    for row in every:
        assert (row["parent"] is not None) == (row["maker"] == "edited")
        assert row["parent"] != row["parts_sha256"]


def test_the_card_counts_what_is_there(made):
    _, front, text = (made / "README.md").read_text().split("---\n", 2)
    files = yaml.safe_load(front)["configs"][0]["data_files"]
    assert [file["split"] for file in files] == list(SPLITS)
    assert CANARY in text
    for column in MACHINES:
        assert f"| `{column.name}` | " in text
        assert column.meaning in text
    for task in TASKS:
        of_task = [row for row in rows(made) if row["task"] == task]
        good = sum(row["outcome"] == "success" and not row["disqualified"] for row in of_task)
        counts = f"{len(of_task)} | {good} | {len(of_task) - good} |"
        assert f"| {split_of(task)} | {task} | {counts}" in text


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_code_of_the_card_runs(made, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    scope: dict = {}
    blocks = re.findall(r"```python\n(.*?)```", (made / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        exec(block.replace('"FOLDER"', f"{str(made)!r}"), scope)
    assert scope["environment"].trials


def test_the_same_seed_is_the_same_bytes_in_any_number_of_processes(made, tmp_path):
    assert make(tmp_path / "two", "--processes", "3").returncode == 0
    assert contents(tmp_path / "two") == contents(made)
    assert make(tmp_path / "fewer", "--count", "5", "--processes", "1").returncode == 0
    assert rows(tmp_path / "fewer") == rows(made)[:5]


@pytest.fixture
def resumed_at(monkeypatch) -> list[int]:
    """The numbers from which machines were drawn."""
    asked: list[int] = []
    orders = Plan.orders

    def counted(plan, first, count):
        asked.append(first)
        return orders(plan, first, count)

    monkeypatch.setattr(Plan, "orders", counted)
    return asked


def test_what_was_interrupted_is_resumed(made, tmp_path, monkeypatch, resumed_at):
    out, journal = tmp_path / "out", tmp_path / ".out.rows.jsonl"
    add = Journal.add

    def interrupted(self, row):
        if row["number"] == COUNT - 4:
            raise KeyboardInterrupt
        add(self, row)

    with monkeypatch.context() as patched:
        patched.setattr(Journal, "add", interrupted)
        assert make(out).returncode != 0
    assert not out.exists()
    with journal.open("ab") as file:
        file.write(b'{"id": "half a ro')
    other = make(out, "--seed", "4", "--processes", "1")
    assert (other.returncode, "interrupted dataset with seed 3" in other.stderr) == (1, True)
    assert make(out).returncode == 0
    assert resumed_at == [0, COUNT - 4]
    assert contents(out) == contents(made)
    assert not journal.exists()


def test_what_was_killed_is_resumed_and_loses_nothing(made, tmp_path, resumed_at):
    out, journal = tmp_path / "out", tmp_path / ".out.rows.jsonl"
    words = ["dataset", "machines", "--out", str(out), *WORDS, "--processes", "1"]
    command = [sys.executable, "-m", "buildarena_cli", *words]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        while not journal.exists() or journal.read_bytes().count(b"\n") < 6:
            assert process.poll() is None
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGKILL)
    assert not out.exists()
    whole = journal.read_bytes().count(b"\n") - 1
    assert 5 <= whole < COUNT
    assert make(out).returncode == 0
    assert resumed_at == [whole]
    assert contents(out) == contents(made)
    assert not journal.exists()


def test_a_full_folder_stays_as_it_is(made):
    before = contents(made)
    done = make(made)
    assert done.returncode == 1
    assert "is not empty (" in done.stderr
    assert contents(made) == before


def test_two_processes_do_not_make_one_dataset(tmp_path):
    plan = Plan(seed=3, tasks=TASKS, simulator="mujoco")
    with Journal(tmp_path / ".out.rows.jsonl", plan.as_document()):
        done = make(tmp_path / "out")
    assert (done.returncode, "another process makes this dataset" in done.stderr) == (1, True)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--task", "suport-1"), 2, "did you mean support-1"),
        (("--task", "hover-3"), 2, "no machines are drawn for task 'hover-3'; they are for"),
        (("--simulator", "besiege"), 1, "besiege"),
    ],
)
def test_nonsense_is_refused(tmp_path, words, code, message):
    done = run("dataset", "machines", "--out", str(tmp_path / "out"), *words)
    assert (done.returncode, message in done.stderr) == (code, True), done.stderr
    assert not list(tmp_path.iterdir())


def test_without_designs_nothing_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "_sources", list)
    done = make(tmp_path / "out")
    assert (done.returncode, "install buildarena-worker" in done.stderr) == (1, True)


def test_a_machine_that_comes_out_different_ends_the_making(tmp_path, monkeypatch):
    monkeypatch.setattr(making, "repeated", lambda rows, *_: ((row, ["mass"]) for row in rows))
    done = make(tmp_path / "out", "--count", "1", "--processes", "1")
    assert (done.returncode, "comes out different when it is made again" in done.stderr) == (
        1,
        True,
    )
    assert not (tmp_path / "out").exists()


def tampered(name: str, row: dict) -> None:
    """One change of a row."""
    calls = json.loads(row["actions"])
    match name:
        case "indicator":
            row["indicator"] += 1e-9
        case "outcome":
            row["outcome"] = "success" if row["outcome"] == "unsuccessful" else "unsuccessful"
        case "trajectory":
            row["trajectory_sha256"] = "0" * 64
        case "actions":
            row["actions"] = json.dumps(calls[:-1])
        case "nonsense":
            row["actions"] = '{"tool": "start"}'
        case "simulator":
            row["simulator"] = "abacus"
        case "split":
            row["split"] = "test"
        case "canary":
            row["canary"] = ""


def test_verify_finds_every_row_that_was_tampered_with(made, tmp_path):
    (folder := tmp_path / "bad").mkdir()
    training = [row for row in rows(made) if row["split"] == "train"]
    names = (
        "indicator",
        "outcome",
        "trajectory",
        "actions",
        "nonsense",
        "simulator",
        "split",
        "canary",
    )
    assert len(training) > len(names)
    for name, row in zip(names, training, strict=False):
        tampered(name, row)
    bad, honest = training[: len(names)], training[len(names) : len(names) + 2]
    twice = dict(honest[-1], number=COUNT)
    table = [*bad, *honest, twice]
    pq.write_table(pa.Table.from_pylist(table, schema=schema(MACHINES)), folder / "train.parquet")
    done = run("dataset", "verify", str(folder), "--processes", "1")
    assert done.returncode == 1
    assert f"{len(table)} machines made again, {len(bad) + 1} differ" in done.stdout
    for row in bad:
        assert f"train.parquet, number {row['number']}, {row['id']}: " in done.stderr
    for row in honest:
        assert f"number {row['number']}," not in done.stderr
    assert f"number {COUNT}, {twice['id']}: another row has the same machine" in done.stderr


def test_verify_passes_what_was_made(made, tmp_path):
    (folder := tmp_path / "few").mkdir()
    for split in SPLITS:
        table = pq.read_table(made / f"{split}.parquet").slice(0, 2)
        pq.write_table(table, folder / f"{split}.parquet")
    done = run("dataset", "verify", str(folder), "--processes", "1")
    assert (done.returncode, done.stderr) == (0, "")
    assert "6 machines made again, 0 differ" in done.stdout


def test_verify_reads_only_datasets_of_machines(tmp_path):
    done = run("dataset", "verify", str(tmp_path))
    assert (done.returncode, "there is no .parquet file" in done.stderr) == (1, True)
    (tmp_path / "train.parquet").write_bytes(b"PAR1")
    done = run("dataset", "verify", str(tmp_path))
    assert (done.returncode, "train.parquet can't be read" in done.stderr) == (1, True)


def test_nothing_leaks_from_split_to_split(made):
    places: defaultdict[str, set[str]] = defaultdict(set)
    for row in rows(made):
        for value in (row["parts_sha256"], row["parent"], row["task"], row["kind"]):
            if value is not None:
                places[value].add(row["split"])
    assert all(len(splits) == 1 for splits in places.values())


def test_no_design_is_made_from_in_two_splits():
    """Of all tasks that machines are drawn for: a design of several tasks is in one split."""
    places: defaultdict[str, set[str]] = defaultdict(set)
    for task in drawable_tasks():
        for seed in range(VARIANTS):
            digest = design_hash(task, seed)
            assert digest is not None, task
            places[digest].add(split_of(task))
    assert all(len(splits) == 1 for splits in places.values())
    assert {split for splits in places.values() for split in splits} == set(SPLITS)


def test_the_papers_tasks_are_among_those_that_take_turns():
    assert set(paper_tasks()) <= set(drawable_tasks()) == set(cycle_of(drawable_tasks()))
    page = Path(__file__).parents[2] / "docs/datasets.md"
    assert f"for {len(drawable_tasks())} of the built-in tasks" in page.read_text()


@pytest.mark.nightly(keep=6)
@pytest.mark.parametrize("task", drawable_tasks())
def test_a_genome_of_calls_calls_the_same(task):
    calls = drawing.design_calls(task, 1)
    again = Genome.from_calls(calls).as_calls()
    machines = []
    for made_of in (calls, again):
        environment = Environment(task)
        for call in made_of:
            assert environment.step(call["tool"], call["arguments"], machine=call["machine"]).ok
        machines.append(environment.submitted())
    assert machines[0] == machines[1]
