"""Stands in for the toolkit's command line: `python -m stand_in_toolkit run --bsg FILE …`.

It reads the machine file and the timeline that it is told, plays them on our engine, and writes a
run folder. Faults on demand, the first of a list each time it runs.
"""

import argparse
import csv
import hashlib
import io
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

from buildarena_besiege import game_start, read_machine_file
from buildarena_besiege.importing.xml_file import parse_file
from buildarena_besiege.timeline import SCHEMA, channel_of
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.besiege_components import besiege_frame, besiege_point, besiege_turn
from buildarena_geometry.poses import Pose
from buildarena_simulation import Scenario, Trajectory, simulate

Row = dict[str, Any]
SANDBOXES: Final = ("BARREN EXPANSE", "LONE ORB")
NAMES: Final = {
    "other_names": {
        "elapsed_seconds": "Time_S",
        "target_guid": "GUID",
        "x": "pos_x",
        "y": "pos_y",
        "z": "pos_z",
        "rot_w": "qw",
        "rot_x": "qx",
        "rot_y": "qy",
        "rot_z": "qz",
    },
    "renamed": {"y": "altitude_msl"},
    "twice": {"input_keys_held": "pos_x"},
}
"""What columns are called, by fault."""


def main() -> int:
    options = _parser().parse_args()
    fault = _next_fault(options.faults)
    if fault == "crash":
        sys.stderr.write("fatal: the game closed\n")
        return 3
    if fault in {"hang", "orphan"}:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        whole = options.pids.with_suffix(".part")
        whole.write_text(json.dumps([os.getpid(), child.pid]))
        whole.replace(options.pids)
        if fault == "hang":
            time.sleep(600)
        time.sleep(1.5)  # long enough to be seen with its child
    if fault == "flood":
        for _ in range(80):
            sys.stdout.write("x" * (1 << 20))
        time.sleep(600)
    if options.sandbox not in SANDBOXES:
        sys.stderr.write(f"there is no sandbox {options.sandbox}\n")
        return 2
    data, timeline = options.bsg.read_bytes(), json.loads(options.controller.read_text())
    machine = read_machine_file(data).machine
    numbers = _numbers(data, machine)
    played = _played(machine, timeline, numbers, options.duration)
    rows = _rows(played, machine, data, options.telemetry_hz)
    _write(options.output / f"run_{time.time_ns()}", rows, options, fault)
    if fault == "two_runs":
        _write(options.output / "run_other", rows, options, fault)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stand_in_toolkit", description=__doc__)
    add = parser.add_argument
    add("action", choices=["run"])
    add("--bsg", type=Path, required=True)
    add("--controller", type=Path, required=True)
    add("--sandbox", required=True)
    add("--telemetry-hz", type=int, required=True)
    add("--output", type=Path, required=True)
    add("--duration", type=float, required=True)
    add("--faults", type=Path)
    add("--pids", type=Path)
    return parser


def _next_fault(file: Path | None) -> str:
    if file is None or not file.exists():
        return ""
    first, *rest = json.loads(file.read_text()) or [""]
    file.write_text(json.dumps(rest))
    return str(first)


def _numbers(data: bytes, machine: Machine) -> dict[int, str]:
    """The machine's blocks by their numbers in the file: both are in the order of creation."""
    count = len(parse_file(data).blocks)
    ids = sorted((part.id for part in machine.state.parts), key=int)
    assert count == len(ids), "a cargo is nothing of this sandbox"
    return dict(enumerate(ids, start=1))


def _played(
    machine: Machine, timeline: dict[str, Any], numbers: dict[int, str], duration_s: float
) -> Trajectory:
    assert timeline["schema"] == SCHEMA
    presses, since = [], {}
    end = {"time": duration_s, "value": 0.0}
    events = [*timeline["events"]]
    events += [{**end, "block": e["block"], "channel": e["channel"]} for e in events]
    for event in events:
        block = machine.blocks[numbers[event["block"]]]
        action = next(
            action
            for action in block.module.actions
            if channel_of(machine, block.id, action) == event["channel"]
        )
        key = block.bindings[action][0]
        if event["value"] > 0.5:
            since[key] = event["time"]
        elif key in since:
            started = since.pop(key)
            held = event["time"] - started
            presses.append(KeyPress(time_s=started, key=key, hold_for_s=held))
    scenario = Scenario.model_validate({"duration_s": duration_s, "control": {"mode": "agent"}})
    start = game_start(machine, scenario)
    return simulate(machine, scenario, "mujoco", start=start, controls=tuple(presses))


def _rows(played: Trajectory, machine: Machine, data: bytes, hz: int) -> list[dict[str, Any]]:
    guids = dict(
        zip(
            _numbers(data, machine).values(), (b.guid for b in parse_file(data).blocks), strict=True
        )
    )
    rows = []
    every = max(1, round(25 / hz))
    for index in range(0, len(played.time_s), every):
        for column, block_id in enumerate(played.block_ids):
            module = machine.blocks[block_id].module
            turn = tuple(played.quaternions[index, column].tolist())
            pose = Pose(position=played.positions[index, column], quaternion=turn)
            root = pose.point(tuple(-value for value in module.center))
            x, y, z = besiege_point(root)
            turned = besiege_turn(turn) if module.kind == "start" else besiege_frame(turn)
            rows.append(
                {
                    "sample_index": index // every,
                    "target_guid": guids[block_id],
                    "elapsed_seconds": round(float(played.time_s[index]), 4),
                    "input_keys_held": "",
                    "x": round(x, 4),
                    "y": round(y, 4),
                    "z": round(z, 4),
                    **{f"rot_{n}": round(v, 6) for n, v in zip("wxyz", turned, strict=True)},
                }
            )
    return rows


def _write(
    folder: Path, rows: list[dict[str, Any]], options: argparse.Namespace, fault: str
) -> None:
    folder.mkdir(parents=True)
    names = list(reversed(rows[0])) if fault == "reordered" else list(rows[0])
    rows = _spoiled(rows, fault)
    shown = NAMES.get(fault, {})
    text = io.StringIO("# tracker_enabled,true\n")
    text.seek(0, io.SEEK_END)
    table = csv.writer(text, lineterminator="\n")
    table.writerow([shown.get(name, name) for name in names])
    table.writerows([[row[name] for name in names] for row in rows])
    telemetry = text.getvalue()
    if fault == "truncated":
        telemetry = telemetry[: int(len(telemetry) * 0.7)].rstrip("\n")
    (folder / "telemetry.csv").write_text(telemetry)
    _write_manifest(folder, options, fault)
    result = {"not_ok": "timeout", "no_result": None}.get(fault, "ok")
    (folder / "summary.json").write_text(json.dumps({"result": result, "samples": len(rows)}))


def _spoiled(rows: list[Row], fault: str) -> list[Row]:
    if fault == "nan":
        rows[len(rows) // 2]["x"] = math.nan
    elif fault == "short":
        return rows[: len(rows) // 2]
    elif fault == "gap":
        return [row for row in rows if not 1.0 < row["elapsed_seconds"] < 1.5]
    elif fault == "other_blocks":
        return [{**row, "target_guid": f"ffff{row['target_guid'][4:]}"} for row in rows]
    elif fault == "one_block":
        return [row for row in rows if row["target_guid"] == rows[0]["target_guid"]]
    elif fault == "backwards":
        return rows[::-1]
    return rows


def _write_manifest(folder: Path, options: argparse.Namespace, fault: str) -> None:
    def told(file: Path, *, other: bool) -> dict[str, str]:
        data = b"another" if other else file.read_bytes()
        return {"path": str(file), "sha256": hashlib.sha256(data).hexdigest()}

    manifest = {
        "bsg": told(options.bsg, other=fault == "other_machine"),
        "controller": told(options.controller, other=fault == "other_keys"),
        "sandbox": SANDBOXES[1] if fault == "other_sandbox" else options.sandbox,
        "telemetry_hz": 10 if fault == "other_rate" else options.telemetry_hz,
    }
    if fault == "silent":
        del manifest["controller"]
    file = folder / "input_manifest.json"
    if fault == "link":
        file.symlink_to("/etc/passwd")
    elif fault == "not_json":
        file.write_text("[" * 100_000)
    else:
        file.write_text(json.dumps(manifest))


if __name__ == "__main__":
    sys.exit(main())
