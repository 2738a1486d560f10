"""Construction trees as files: every command that reads machines reads them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from buildarena_besiege import plain_machine_file, read_any_machine, read_machine_file
from buildarena_cli.main import app
from buildarena_geometry import DocumentError, Machine

CAR = [
    {"id": "0", "order_id": 0, "parent": -1, "bp_id": -1},
    {"id": 1, "order_id": 1, "parent": 0, "bp_id": 0},
    *({"id": 2, "order_id": 2 + k, "parent": 0, "bp_id": 2 + k} for k in range(2)),
    *({"id": 2, "order_id": 4 + k, "parent": 1, "bp_id": (2, 4)[k]} for k in range(2)),
    {"id": 7, "order_id": 6, "parent_a": 0, "bp_id_a": 4, "parent_b": 1, "bp_id_b": 6},
]


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["machine", *arguments])


def test_a_tree_is_told_from_other_files_and_becomes_a_machine() -> None:
    imported = read_any_machine(json.dumps(CAR).encode(), where="car.json")
    machine = imported.machine
    assert machine.part_count == 7
    (remark,) = imported.not_understood
    assert remark.startswith("wheels turn by themselves where the tree is from")
    assert Machine.from_document(machine.to_document()) == machine


def test_a_trees_machine_stays_the_same_as_the_games_file() -> None:
    machine = read_any_machine(json.dumps(CAR).encode(), where="car.json").machine
    back = read_machine_file(plain_machine_file(machine, name="car")).machine
    assert [block.mount for block in back.blocks.values()] == [
        block.mount for block in machine.blocks.values()
    ]
    assert [block.flipped for block in back.blocks.values()] == [
        block.flipped for block in machine.blocks.values()
    ]


@pytest.mark.parametrize(
    "command", [("import",), ("check",), ("export", "--out", "car.svg"), ("import", "--json")]
)
def test_commands_read_trees(command: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "car.json"
    file.write_text(json.dumps(CAR))
    name, *options = [str(tmp_path / part) if part == "car.svg" else part for part in command]
    result = run(name, str(file), *options)
    assert result.exit_code == 0, result.output


def test_import_writes_the_machine_document(tmp_path: Path) -> None:
    file, out = tmp_path / "car.json", tmp_path / "machine.json"
    file.write_text(json.dumps(CAR))
    assert run("import", str(file), "--out", str(out)).exit_code == 0
    assert Machine.from_document(json.loads(out.read_text())).part_count == 7


def test_a_wrong_tree_is_refused_by_file_entry_and_line(tmp_path: Path) -> None:
    wrong = [*CAR, {"id": 22, "order_id": 7, "parent": 9, "bp_id": 0}]
    file = tmp_path / "car.json"
    file.write_text("[\n" + ",\n".join(json.dumps(entry) for entry in wrong) + "\n]\n")
    result = run("import", str(file))
    assert result.exit_code == 1
    assert "entry 7 (id 22, line 9): parent 9 is not an earlier entry" in result.output
    with pytest.raises(DocumentError, match=r"car.json: entry 7 \(id 22, line 1\)"):
        read_any_machine(json.dumps(wrong).encode(), where="car.json")
