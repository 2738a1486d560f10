"""`python -m buildarena_geometry replay`: sequences in, JSON lines out."""

import gzip
import io
import json
from types import SimpleNamespace

import pytest

from buildarena_geometry.__main__ import main

STEPS = [
    {"op": "start", "params": {}},
    {"op": "attach_block_to", "params": {"base_block": 1, "face": "A", "new_block": "Torch"}},
    {"op": "attach_block_to", "params": {"base_block": "1", "face": "A", "new_block": "Torch"}},
]


@pytest.fixture
def replay(capsys):
    def run(*arguments):
        code = main(["replay", *map(str, arguments)])
        out = capsys.readouterr()
        results = [json.loads(line) for line in out.out.splitlines()]
        return SimpleNamespace(code=code, results=results, error=out.err)

    return run


def test_every_step_tells_verdict_kind_and_state(tmp_path, replay):
    file = tmp_path / "one.json"
    file.write_text(json.dumps({"seed": 7, "steps": STEPS}))
    (results,) = replay(file).results
    assert results["seed"] == 7
    assert [step["kind"] for step in results["steps"]] == ["ok", "ok", "face_occupied"]
    assert [step["ok"] for step in results["steps"]] == [True, True, False]
    assert [step["state"]["n"] for step in results["steps"]] == [1, 2, 2]


def test_standard_input_is_read_plain_and_compressed(monkeypatch, replay):
    for data in (json.dumps(STEPS).encode(), gzip.compress(json.dumps(STEPS).encode())):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
        assert len(replay("-").results[0]["steps"]) == 3


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "input: not JSON"),
        (b"3", "input: expected a list"),
        (b"[3]", "input[0]: expected an object"),
        (b'[{"params": {}}]', "input[0]: op is missing"),
        (b'{"seed": 1}', "input: steps is missing"),
        (b'{"steps": 1}', "input.steps: expected a list"),
        (b'{"steps": [], "sub_machines": [1]}', "input.sub_machines: expected an object"),
        (b"\xff\xfe", "input: not JSON"),
        (b"\x1f\x8bjunk", "input: not gzip"),
        (gzip.compress(b"[]" * 9, mtime=0)[:-9], "input: not gzip"),
        (b"[" * 100_000, "input: not JSON"),
    ],
)
def test_input_that_is_no_sequence_is_refused_with_its_place(tmp_path, replay, content, message):
    file = tmp_path / "bad.json"
    file.write_bytes(content)
    result = replay(file)
    assert result.code == 1
    assert message in result.error
