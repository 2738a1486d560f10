"""Builds with a module of one's own: a long beam, described in a file.

The entry says nothing about physics, so that of the first basic block applies.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from buildarena_geometry import Machine, load_catalogue

LOG = {
    "name": "Log",
    "kind": "block",
    "mass": 0.9,
    "cost": 2,
    "size": [1, 1, 3],
    "center": [0, 0, 1.5],
    "faces": [{"label": "E", "center": [0, 0, 3], "normal": [0, 0, 1], "x_axis": [1, 0, 0]}],
    "colliders": [{"shape": "box", "from": [-0.32, -0.32, 0], "to": [0.32, 0.32, 2.8]}],
    "body": [{"shape": "box", "from": [-0.5, -0.5, 0], "to": [0.5, 0.5, 3]}],
    "description": "A wooden beam three units long, with a face at its far end.",
    "besiege": {"id": 63, "data": []},
}


def build_pole() -> Machine:
    """Two logs on top of a starting block."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "modules.json"
        file.write_text(json.dumps({"version": 1, "modules": [LOG]}))
        catalogue = load_catalogue(file)
    pole = Machine(catalogue=catalogue)
    pole.act("start")
    pole.act("attach_block_to", {"base_block": "1", "face": "C", "new_block": "Log"})
    pole.act("attach_block_to", {"base_block": "2", "face": "E", "new_block": "Log"})
    return pole


if __name__ == "__main__":
    print(build_pole().act("get_machine_summary").text)
