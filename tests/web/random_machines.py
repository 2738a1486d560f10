"""Machines built by random tool calls, here and over the tools API, and where all parts must be."""

import random
from typing import Any

import httpx

from buildarena_geometry import Block, Machine, Refused

MODULES = ("Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch", "Starting Block", "Rope")
CONNECTORS = ("Brace", "Winch", "Small Wooden Block")
WEIGHTS = {
    "attach_block_to": 10,
    "connect_blocks": 4,
    "remove_block": 1,
    "twist_block": 2,
    "shift_block": 2,
    "flip_spin": 1,
    "change_control_key": 1,
}
CALLS = 15

Steps = list[dict[str, Any]]


def built_session(client: httpx.Client, agent: str, seeds: range) -> dict[str, Any]:
    """A session with one machine a seed.

    Returns:
        The job's id, and after each step where the geometry library says that every part is.
    """
    body = {"task": "support-1", "agent": agent, "seed": seeds[0], "simulator": "mujoco"}
    job = client.post("/v1/sessions", json=body).raise_for_status().json()["id"]
    steps: Steps = []
    for seed in seeds:
        steps += _built(client, job, seed)
    return {"job": job, "steps": steps}


def _built(client: httpx.Client, job: str, seed: int) -> Steps:
    chance, machine, steps = random.Random(seed), Machine(), list[dict[str, Any]]()
    for number in range(CALLS):
        tool, arguments = ("start", _start(chance)) if number == 0 else _call(chance, machine)
        outcome = machine.act(tool, arguments)
        told = client.post(
            f"/v1/sessions/{job}/calls",
            json={"tool": tool, "arguments": arguments, "machine": f"machine-{seed}"},
        )
        assert told.raise_for_status().json()["ok"] == outcome.ok
        tried = outcome.attempted if isinstance(outcome, Refused) else ()
        steps.append(
            {
                "blocks": {block.id: _pose(block) for block in machine.blocks.values()},
                "rods": {
                    link.id: [*link.start_xyz, *link.end_xyz]
                    for link in machine.connectors.values()
                },
                "ghosts": [[*block.position, *block.quaternion] for block in tried],
            }
        )
    return steps


def _pose(block: Block) -> list[float]:
    pose = block.world_from_block
    return [*pose.xyz, *pose.wxyz]


def _start(chance: random.Random) -> dict[str, Any]:
    return {
        "init_shift": [round(chance.uniform(-5, 5), 3) for _ in range(3)],
        "init_rotation": [chance.choice((0, 30, 45, 90)) for _ in range(3)],
    }


def _call(chance: random.Random, machine: Machine) -> tuple[str, dict[str, Any]]:
    tool = chance.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
    ids = [*machine.blocks, "99"]

    def block() -> str:
        return chance.choice(ids)

    def face() -> str:
        return chance.choice("ABCDEFG")

    arguments: dict[str, dict[str, Any]] = {
        "attach_block_to": {
            "base_block": block(),
            "face": face(),
            "new_block": chance.choices(MODULES, (8, 3, 2, 2, 1, 1))[0],
        },
        "connect_blocks": {
            "block_a": block(),
            "face_a": face(),
            "block_b": block(),
            "face_b": face(),
            "connector": chance.choices(CONNECTORS, (5, 3, 1))[0],
        },
        "remove_block": {"block_id": chance.choice([*ids, *machine.connectors])},
        "twist_block": {"block_id": block(), "angle": chance.choice((15, 45, 90, 180))},
        "shift_block": {
            "block_id": block(),
            "shift_real": [round(chance.uniform(-0.6, 0.6), 3) for _ in range(3)],
        },
        "flip_spin": {"block_id": block()},
        "change_control_key": {
            "block_id": block(),
            "action": "spinning_forward",
            "new_key": chance.choice(("UpArrow", "Alpha1")),
        },
    }
    return tool, arguments[tool]
