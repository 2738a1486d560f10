"""The random model, which makes well-formed tool calls at random.

Its scores show what chance achieves. It is a function of the request and its seed.
"""

import json
import random
from typing import Any

from buildarena_benchmark.environment.tools import OBJECTION
from buildarena_geometry import ToolDefinition
from buildarena_worker.builtin.reading import Situation, read_situation
from buildarena_worker.session.messages import Completion, Request, ToolCall

BLOCKS = ("Small Wooden Block", "Powered Wheel", "Water Cannon", "Torch", "Steel Beam")
CONNECTORS = ("Brace", "Winch", "Torch")
FACES = "ABCDEFG"
KEYS = ("UpArrow", "DownArrow", "Alpha1", "Space")
MIN_ACTIONS, MAX_ACTIONS = 6, 14

PLAN = """<building_plan>
<overall_structure>whatever luck makes of it</overall_structure>
<sub_structures>{parts}</sub_structures>
</building_plan>"""
PART = """<sub_structure><name>part_{number}</name>
<description>a random heap</description></sub_structure>"""


def reply(request: Request) -> Completion:
    """Return a random reply of the kind that the role expects."""
    situation = read_situation(request)
    rng = _rng(request, situation)
    if situation.role == "planner":
        count = 2 if "exactly 2 sub-structures" in request.messages[-1].text else 1
        parts = "".join(PART.format(number=number + 1) for number in range(count))
        return Completion(text=PLAN.format(parts=parts))
    if situation.role == "drafter":
        return Completion(text="A heap of blocks, each on some face of another.")
    if situation.role == "reviewer":
        return Completion(text="TERMINATE")
    if situation.role == "guidance":
        return _guide(situation, request)
    if situation.role == "controller":
        return Completion(text=_program(rng))
    return _act(situation, request, rng)


def _rng(request: Request, situation: Situation) -> random.Random:
    # A text seed is hashed by SHA-512 and so the same everywhere.
    return random.Random(  # noqa: S311 - chance, not secrecy
        f"{request.seed}/{situation.task}/{situation.part}/{situation.role}/{situation.own_turns}"
    )


def _length(request: Request, situation: Situation) -> int:
    rng = random.Random(f"{request.seed}/{situation.task}/{situation.part}")  # noqa: S311 - as above
    return rng.randint(MIN_ACTIONS, MAX_ACTIONS)


def _guide(situation: Situation, request: Request) -> Completion:
    max_turns = 2 if situation.refining else _length(request, situation)
    if situation.builder_turns >= max_turns:
        return Completion(text="TERMINATE")
    return Completion(text=f"{situation.builder_turns + 1}. Do something.")


def _act(situation: Situation, request: Request, rng: random.Random) -> Completion:
    tools = {tool.name: tool for tool in request.tools if tool.name != OBJECTION.name}
    if not tools or (
        situation.role == "engineer" and situation.own_turns >= _length(request, situation)
    ):
        return Completion(text="TERMINATE")
    if situation.own_actions == 0 and "start" in tools:
        name = "start"
    elif "attach_block_to" in tools and not situation.assembling and rng.random() < 0.7:  # noqa: PLR2004 - mostly blocks, so that heaps grow
        name = "attach_block_to"
    else:
        name = rng.choice(sorted(tools))
    call = ToolCall(
        id=f"call_{situation.own_turns}",
        name=name,
        arguments=_arguments(tools[name], situation, rng),
    )
    return Completion(text="", calls=(call,), finish="stop")


def _arguments(tool: ToolDefinition, situation: Situation, rng: random.Random) -> dict[str, Any]:
    properties = tool.parameters.get("properties", {})
    required = tool.parameters.get("required", [])
    return {name: _value(name, properties[name], situation, rng) for name in required}


def _value(name: str, schema: Any, situation: Situation, rng: random.Random) -> Any:
    if "block" in name and "new" not in name:
        number = str(rng.randint(1, max(1, situation.own_actions + 1)))
        return f"{rng.choice('AB')}_{number}" if situation.assembling else number
    if "face" in name:
        return rng.choice(FACES)
    choices: dict[str, Any] = {
        "new_block": rng.choice(BLOCKS),
        "connector": rng.choice(CONNECTORS),
        "machine_id": f"part_{rng.randint(1, 2)}",
        "machine_index": rng.choice("AB"),
    }
    if name in choices:
        return choices[name]
    kind = schema.get("type") if isinstance(schema, dict) else None
    if kind == "array":
        return [round(rng.uniform(-1, 1), 2) for _ in range(3)]
    if kind in {"number", "integer"}:
        return rng.randint(-180, 180)
    return "by chance"


def _program(rng: random.Random) -> str:
    return json.dumps(
        {
            "control_design": "by chance",
            "control_config": [
                {
                    "block": str(rng.randint(1, 8)),
                    "action": rng.choice(("spinning_forward", "hold_to_fire")),
                    "keys": [rng.choice(KEYS)],
                }
            ],
            "control_sequence": [{"time": 2.0, "key": rng.choice(KEYS), "hold_for": 3.0}],
        }
    )
