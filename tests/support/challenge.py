"""Packages of a challenge: public machines with flights and transcripts of our own."""

import io
import json
import math
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path

from buildarena_besiege.exporting.machine_file import Guids, block_records, machine_text
from buildarena_besiege.logs.tracker_file import COLUMNS
from buildarena_besiege.placement import GlobalPose
from buildarena_geometry.machine_files import machine_of
from buildarena_worker.builtin.designs import DESIGNS

DATA = Path(__file__).parents[1] / "data" / "challenge"
MACHINES = ("three_blocks", "five_blocks")
CENTER = (0.0, -400.0, 0.0)
HEAD = (
    "# tracker_enabled,true\n# target_guids,{guid}\n# sample_rate_hz,10\n"
    "# sample_interval_seconds,0.100000001\n"
)
TRANSCRIPT = "# A conversation\n\n" + "> Build the smallest machine that flies.\n\n" * 10


def flight_text(
    guid: str,
    *,
    blocks: int,
    cycles: float = 3.2,
    omega: float = 0.25,
    radius: float = 500.0,
    center: tuple[float, float, float] = CENTER,
    integrity: float = 1.0,
) -> str:
    """A flight on a circle about the centre, begun at rest: the speed grows for 20 s.

    The first second is spent on the spot; the circle lies in the x-y plane.
    """
    rows, angle, k = [], math.pi / 2, 0
    while angle - math.pi / 2 < 2 * math.pi * cycles:
        time_s = 0.1 * k
        angle += 0.1 * omega * min(1.0, max(0.0, (time_s - 1.0) / 20.0))
        x, y = center[0] + radius * math.cos(angle), center[1] + radius * math.sin(angle)
        values = {
            "sample_index": k,
            "target_index": 0,
            "target_guid": guid,
            "target_name": "StartingBlock",
            "elapsed_seconds": round(time_s, 4),
            "unity_time_seconds": round(3604.5 + time_s, 4),
            "machine_integrity": integrity,
            "machine_block_health_sum": 0,
            "machine_block_max_health_sum": 0,
            "machine_block_count": blocks,
            "machine_cluster_count": 1,
            "target_block_health": 0,
            "target_block_max_health": 0,
            "x": round(x, 6),
            "y": round(y, 6),
            "z": center[2],
            "rot_w": 1,
            "rot_x": 0,
            "rot_y": 0,
            "rot_z": 0,
        }
        rows.append(",".join(str(values.get(name, "")) for name in COLUMNS))
        k += 1
    return HEAD.format(guid=guid) + "\n".join([",".join(COLUMNS), *rows]) + "\n"


def package_files(machine: str) -> dict[str, bytes]:
    """The six files of a sound package."""
    files = {file.name: file.read_bytes() for file in (DATA / machine).iterdir()}
    raw = files["machine_raw.bsg"].decode()
    guid = raw.split('<Block id="0" guid="')[1].split('"')[0]
    files["trajectory.csv"] = flight_text(guid, blocks=raw.count("<Block ")).encode()
    files["chat_transcript.md"] = TRANSCRIPT.encode()
    return files


BRACED = (
    ("start", {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]}),
    ("attach_block_to", {"base_block": 1, "face": "f0", "new_block": "Single Wooden Block"}),
    ("attach_block_to", {"base_block": 1, "face": "f2", "new_block": "Single Wooden Block"}),
    (
        "connect_blocks",
        {"block_a": 2, "face_a": "f0", "block_b": 3, "face_b": "f0", "connector": "Brace"},
    ),
)
"""Actions of the public interface that join two blocks by a brace."""


def braced_files() -> dict[str, bytes]:
    """A sound package of a machine with a brace, whose raw file is ours."""
    history = [{"op": name, "params": arguments} for name, arguments in BRACED]
    machine = machine_of(history, where="history", version="2.0")
    guids = Guids(new_guid=iter(uuid.UUID(int=n << 100) for n in range(1, 9)).__next__)
    records = block_records(machine, guids, keys={})
    upright = GlobalPose(position=(0.0, 5.0, 0.0), rotation=(1.0, 0.0, 0.0, 0.0))
    whole = machine_text("braced", upright, records, "")
    before, after = whole.index("    <Data>\n"), whole.index("    </Data>\n")
    raw = (whole[:before] + "    <Data>\n" + whole[after:]).encode()
    guid = next(record.guid for record in records)
    flight = flight_text(guid, blocks=len(records))
    return {
        "machine_raw.bsg": raw,
        "machine_tuned.bsg": raw,
        "build_history.json": json.dumps(history).encode(),
        "build_history_full.json": json.dumps(history).encode(),
        "trajectory.csv": flight.encode(),
        "chat_transcript.md": TRANSCRIPT.encode(),
    }


def bridge_files() -> dict[str, bytes]:
    """A package of first-bridges: the expert's machines, as their actions."""
    files = {"chat_transcript.md": TRANSCRIPT.encode()}
    for task in ("support-1", "support-2", "support-3"):
        (part,) = DESIGNS[task](0).parts.values()
        actions = [{"op": tool, "params": arguments} for tool, arguments in part.actions]
        files[f"{task}.json"] = json.dumps(actions).encode()
    return files


def packed(machine: str = "three_blocks", note: str = "") -> bytes:
    """A sound package as a ZIP file; another note, another file."""
    files = package_files(machine)
    if note:
        files["chat_transcript.md"] += note.encode()
    return zipped(files)


def zipped(files: Mapping[str, bytes], *, folder: str = "") -> bytes:
    """Files as a ZIP file, in a folder of it where one is named."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(folder + name), content, zipfile.ZIP_DEFLATED)
    return data.getvalue()
