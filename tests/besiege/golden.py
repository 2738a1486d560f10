"""The golden machines as machines of ours, and their exports."""

import gzip
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import KeyPress, Machine, load_catalogue
from buildarena_geometry.besiege_components import pose_from_besiege

DATA = Path(__file__).parents[1] / "data"
LEVELS = ("soft", "medium", "hard")


@dataclass(frozen=True)
class Golden:
    """One golden machine, and what the published library exports of it."""

    name: str
    entry: dict[str, Any]

    @property
    def exports(self) -> list[dict[str, Any]]:
        return self.entry["exports"]

    @property
    def state(self) -> dict[str, Any]:
        return _state(self.name)

    def machine(self, *, controlled: bool) -> Machine:
        """The machine; with the keys of its control configuration if it is controlled."""
        return _machine(self.name, controlled=controlled).copy()

    def played(self, export: dict[str, Any]) -> tuple[Machine, list[KeyPress]]:
        """What was exported: the machine with its keys, and the control sequence."""
        control = self.entry["control"]
        plain = export["category"] == "plain"
        if control is None or not (
            export["category"] == "transport" or (plain and control["source"] == "vector")
        ):
            return self.machine(controlled=False), []
        presses = [
            KeyPress(time_s=one["time"], key=one["key"], hold_for_s=one["hold_for"])
            for one in control["control_sequence"]
        ]
        return self.machine(controlled=True), presses


@cache
def content() -> dict[str, Any]:
    return json.loads(gzip.decompress((DATA / "besiege" / "machines.json.gz").read_bytes()))


@cache
def goldens() -> tuple[Golden, ...]:
    machines = content()["machines"]
    return tuple(Golden(name=f"{one['set']}-{one['seed']}", entry=one) for one in machines)


def golden(name: str) -> Golden:
    return next(one for one in goldens() if one.name == name)


def scenario_of(export: dict[str, Any]):
    """The scenario of an export's task; None for a plain one."""
    if export["category"] == "plain":
        return None
    task = f"{export['category']}-{LEVELS.index(export['level']) + 1}"
    return builtin_tasks()[task].scenario


@cache
def _states() -> dict[str, Any]:
    """By machine, the states of the geometry vectors that were exported, without the rest."""
    return json.loads(gzip.decompress((DATA / "besiege" / "states.json.gz").read_bytes()))


def _state(name: str) -> dict[str, Any]:
    return _states()[name]


@cache
def _machine(name: str, *, controlled: bool) -> Machine:
    entry = golden(name).entry
    keys: dict[str, dict[str, list[str]]] = {}
    if controlled:
        for one in entry["control"]["control_config"]:
            bound = keys.setdefault(one["block_id"], {}).setdefault(one["action"], [])
            bound += [] if one["key"] in bound else [one["key"]]
    return Machine.from_document(document_of(_state(name), keys))


def played_document(found: Golden, export: dict[str, Any]) -> dict[str, Any]:
    """What was exported as a machine document: keys and control sequence included."""
    machine, presses = found.played(export)
    document = machine.to_document()
    document["control_sequence"] = [
        {"time_s": one.time_s, "key": one.key, "hold_for_s": one.hold_for_s} for one in presses
    ]
    return document


def document_of(state: dict[str, Any], keys: dict[str, dict[str, list[str]]]) -> dict[str, Any]:
    """The machine document of a vector's state."""
    letters = sorted({b["id"].split("_")[0] for b in state["blocks"] if "_" in b["id"]})
    parts = sorted(state["blocks"], key=lambda b: (b["id"].isdigit(), *_place(b["id"])))
    parts = [b for b in parts if not dangles(b)]
    blocks = [_block(b, keys.get(b["id"], {})) for b in parts if "connector" not in b]
    roots = {b["structure"]: b["id"] for b in blocks if b["module"] == "Starting Block"}
    return {
        "version": 1,
        "blocks": blocks,
        "joints": [],
        "connectors": [_connector(b) for b in parts if "connector" in b],
        "control_sequence": [],
        "structures": [
            {"letter": letter, "source": "part", "root": roots[letter]} for letter in letters
        ],
        "structures_made": len(letters),
        "next_id": state["next_id"],
        "available": {"part": Machine().to_document()} if letters else {},
        "log": [],
    }


def dangles(b: dict[str, Any]) -> bool:
    """Whether it is a connector on a removed block, which the published library leaves behind."""
    link = b.get("connector", {})
    return "_" not in b["id"] and any(link.get(end, [""])[0] is None for end in ("start", "end"))


def _place(part: str) -> tuple[str, int]:
    letter, _, number = part.rpartition("_")
    return (letter, int(number))


def _common(b: dict[str, Any]) -> dict[str, Any]:
    module = load_catalogue()[b["name"]]
    pose = pose_from_besiege(module, tuple(b["virtual"]), tuple(b["quat"]))
    found = {"id": b["id"], "module": b["name"], "position": list(pose.xyz)}
    structure = b["id"].split("_")[0] if "_" in b["id"] else ""
    return {**found, "quaternion": list(pose.wxyz), "structure": structure}


def _face(b: dict[str, Any], face: list[Any]) -> list[str]:
    if face[0] is not None:
        return [face[0], face[1]]
    return [f"{b['id'].split('_')[0]}_{face[2]}", face[1]]


def _block(b: dict[str, Any], keys: dict[str, list[str]]) -> dict[str, Any]:
    entry = {**_common(b), "flipped": b["flipped"], "bindings": keys}
    face = b.get("root_face")
    lost = face is not None and face[0] is None and "_" not in b["id"]
    if face is not None and not lost:
        entry["mount"] = _face(b, face)
    if lost:
        entry["lost_mount"] = [face[2], face[1]]
    return entry


def _connector(b: dict[str, Any]) -> dict[str, Any]:
    link = b["connector"]
    x, y, z = link["projection_virtual"]
    ends = {"start": _face(b, link["start"]), "end": _face(b, link["end"])}
    return {**_common(b), **ends, "span": [-x, y, z]}
