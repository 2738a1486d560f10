"""The expert: a scripted engineer with prepared designs. Its scores are a reference.

It plays every role like any model: it reads the request, derives the progress of the work from
it, and returns the next text or tool call.
"""

import json
from collections.abc import Sequence
from functools import lru_cache

from buildarena_benchmark.experts import expert_designs
from buildarena_benchmark.experts.design import Design
from buildarena_benchmark.experts.drafting import Action
from buildarena_worker.builtin.reading import Situation, read_situation
from buildarena_worker.session.messages import Completion, Request, ToolCall

DONE = "TERMINATE"
DESCRIBE = "describe_module"
STEPS = 10
"""Steps sent to a builder in one message."""
DESIGNERS = ("planner", "drafter", "guidance", "engineer")
"""Roles that look up modules; guidance does so only without a drawing."""


def reply(request: Request) -> Completion:
    """Return the next text or tool call; end at once if there is no design for the task."""
    situation = read_situation(request)
    if situation.task not in expert_designs():
        return Completion(text=f"I have no design for {situation.task or 'this task'}. {DONE}")
    design = _design(situation.task, request.seed)
    looking = _look_up(design, situation, request)
    if looking is not None:
        return looking
    speakers = {
        "planner": lambda: Completion(text=_plan(design)),
        "drafter": lambda: Completion(text=_drawing(design, situation)),
        "reviewer": lambda: Completion(text=DONE),
        "guidance": lambda: _guide(design, situation),
        "builder": lambda: _build(design, situation, request),
        "engineer": lambda: _act(_whole_script(design), situation.own_actions),
        "controller": lambda: Completion(text=_control(design, situation)),
    }
    speak = speakers.get(situation.role)
    return speak() if speak else Completion(text=DONE)


@lru_cache(maxsize=1024)  # sessions that one process may run at once
def _design(task: str, seed: int) -> Design:
    return expert_designs()[task](seed)


def _look_up(design: Design, situation: Situation, request: Request) -> Completion | None:
    """Return the call by which a designing role looks up the modules it uses."""
    if situation.own_lookups or not any(tool.name == DESCRIBE for tool in request.tools):
        return None
    if situation.role not in DESIGNERS or (situation.role == "guidance" and situation.has_drawing):
        return None
    parts = design.parts.values()
    everything = [action for part in parts for action in part.actions]
    script = everything if situation.role == "planner" else _script(design, situation)
    used = _modules(script)
    call = ToolCall(id="look_1", name=DESCRIBE, arguments={"module": ", ".join(used)})
    return Completion(text="", calls=(call,)) if used else None


def _modules(script: Sequence[Action]) -> list[str]:
    """Return the modules that actions name, without duplicates."""
    return list(
        dict.fromkeys(
            str(value)
            for _, arguments in script
            for argument, value in arguments.items()
            if argument in ("new_block", "connector")
        )
    )


def _plan(design: Design) -> str:
    parts = "".join(
        f"<sub_structure><name>{name}</name><description>{part.description}</description>"
        f"<components>{', '.join(_modules(part.actions))}</components>"
        f"<assembly>{len(part.actions)} actions</assembly></sub_structure>\n"
        for name, part in design.parts.items()
    )
    return (
        f"<building_plan>\n<overall_structure>{design.overall}</overall_structure>\n"
        f"<sub_structures>\n{parts}</sub_structures>\n</building_plan>"
    )


def _script(design: Design, situation: Situation) -> Sequence[Action]:
    if situation.assembling:
        return design.assembly
    part = design.parts.get(situation.part or "")
    if part is None:
        return _whole_script(design)
    return part.actions


def _whole_script(design: Design) -> Sequence[Action]:
    """Return all actions of a design, for workflows without sub-structures."""
    return next(iter(design.parts.values())).actions


def _control(design: Design, situation: Situation) -> str:
    if design.steer is None and situation.may_keep:
        return "KEEP"
    if design.program:
        return f"```lua\n{design.program}```"
    return json.dumps(design.steer(situation.trials) if design.steer else design.control)


def _drawing(design: Design, situation: Situation) -> str:
    steps = "\n".join(
        f"{number}. {_describe(action)}"
        for number, action in enumerate(_script(design, situation), start=1)
    )
    return f"Drawing of {situation.part}, in building order:\n{steps}"


def _build(design: Design, situation: Situation, request: Request) -> Completion:
    if not situation.own_turns and not situation.refining:
        names = ", ".join(tool.name for tool in request.tools)
        return Completion(text=f"My tools: {names}. Tell me blocks by number and faces by letter.")
    return _act(_script(design, situation), situation.own_actions)


def _guide(design: Design, situation: Situation) -> Completion:
    script = _script(design, situation)
    # The builder's first reply only lists its tools.
    done = situation.builder_turns - 1
    if situation.refining or done >= len(script):
        return Completion(text=DONE)
    steps = enumerate(script[done : done + STEPS], start=done + 1)
    return Completion(text="\n".join(f"{number}. {_describe(action)}" for number, action in steps))


def _act(script: Sequence[Action], done: int) -> Completion:
    if done >= len(script):
        return Completion(text=DONE)
    name, arguments = script[done]
    call = ToolCall(id=f"call_{done + 1}", name=name, arguments=dict(arguments))
    return Completion(text="", calls=(call,))


def _describe(action: Action) -> str:
    """Format an action: the tool and the values of its arguments, in their order."""
    name, arguments = action
    return f"{name}: " + ", ".join(str(value) for value in arguments.values() if value)
