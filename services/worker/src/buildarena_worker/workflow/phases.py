"""The phases that workflows are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from buildarena_geometry import Machine
from buildarena_worker.session.dialogue import OBJECTION, TERMINATE, Dialogue, Role
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.machine_tools import (
    ASSEMBLE,
    BUILD,
    REFINE,
    acting_on,
    modules_text,
    tools_named,
)
from buildarena_worker.workflow.plan import Plan, PlanError, SubStructure, read_plan

DRAFT_TURNS = 50
BUILD_TURNS = 300
"""Replies a phase may take. Source: the paper's workflow appendix."""
SHOWN = 200
"""Characters of a reply that a failure quotes."""


def plan_phase(session: Session) -> Plan:
    """Lets the planner write a plan, with a second attempt when it can't be read.

    Raises:
        ConstructionFailedError: No readable plan, or one with too many sub-structures.
    """
    pack, task = session.pack, session.task
    opening = pack.say(
        "plan",
        task=task.name,
        statement=session.statement,
        modules=modules_text(task.constraints.modules),
    )
    dialogue = Dialogue(session, phase="plan", opening=opening)
    planner = Role(name="planner", system=pack.roles["planner"])
    extra = ""
    for last in (False, True):
        text = dialogue.turn(planner, extra=extra).text
        try:
            plan = read_plan(text)
        except PlanError as error:
            if last:
                detail = f"{error}; the planner said {text[:SHOWN]!r}"
                raise ConstructionFailedError("plan_unreadable", detail) from error
            extra = pack.say("plan_again", error=str(error))
        else:
            _check_plan(session, plan)
            return plan
    raise AssertionError("the second attempt returns or raises")


def _check_plan(session: Session, plan: Plan) -> None:
    limits = session.task.constraints
    count = len(plan.sub_structures)
    fewest, most = limits.min_sub_structures, limits.max_sub_structures
    if not fewest <= count <= most:
        allowed = str(most) if fewest == most else f"{fewest} to {most}"
        raise ConstructionFailedError(
            "constraint_violated",
            f"the plan has {count} sub-structures, the task allows {allowed}",
        )


def draft_phase(session: Session, plan: Plan, part: SubStructure) -> str:
    """Lets drafter and reviewer alternate; the drafter's final drawing.

    Raises:
        ConstructionFailedError: An objection, or no agreement within the turn limit.
    """
    pack, task = session.pack, session.task
    opening = pack.say(
        "draft",
        task=task.name,
        statement=session.statement,
        modules=modules_text(task.constraints.modules),
        overall=plan.overall,
        name=part.name,
        sub_structure=part.text,
    )
    dialogue = Dialogue(session, phase="draft", opening=opening, sub_structure=part.name)
    drafter = Role(name="drafter", system=pack.roles["drafter"])
    reviewer = Role(name="reviewer", system=pack.roles["reviewer"], tools=[OBJECTION])
    for turn in range(DRAFT_TURNS):
        if turn % 2 == 0:
            dialogue.turn(drafter)
        elif TERMINATE.search(dialogue.turn(reviewer).text):
            return dialogue.turn(drafter, extra=pack.say("blueprint", name=part.name)).text
    raise ConstructionFailedError(
        "turn_limit", f"no agreed drawing of {part.name} within {DRAFT_TURNS} turns"
    )


def build_phase(session: Session, part: SubStructure, blueprint: str) -> Machine:
    """Lets builder and guidance alternate, the builder first, until guidance ends it.

    Raises:
        ConstructionFailedError: An objection, or the turn limit.
    """
    machine = Machine()
    session.machine = machine
    opening = session.pack.say("build", task=session.task.name, name=part.name, blueprint=blueprint)
    dialogue = Dialogue(session, phase="build", opening=opening, sub_structure=part.name)
    builder, guidance = _builder(session, machine, BUILD), _guidance(session)
    _alternate(dialogue, (builder, guidance), ends=guidance, what=f"building {part.name}")
    return machine


def refine_phase(session: Session, machine: Machine, part: SubStructure, blueprint: str) -> None:
    """Lets guidance and builder correct powered parts, when the machine has wheels."""
    if not any(block.module.spins for block in machine.blocks.values()):
        return
    opening = session.pack.say(
        "refine",
        task=session.task.name,
        name=part.name,
        blueprint=blueprint,
        summary=machine.act("get_machine_summary", {}).text,
    )
    dialogue = Dialogue(session, phase="refine", opening=opening, sub_structure=part.name)
    builder, guidance = _builder(session, machine, REFINE), _guidance(session)
    _alternate(dialogue, (guidance, builder), ends=guidance, what=f"refining {part.name}")


def assemble_phase(session: Session, plan: Plan, machines: Mapping[str, Machine]) -> Machine:
    """Lets builder and guidance put the sub-structures together."""
    assembly = Machine(available=machines)
    session.machine = assembly
    parts = "\n\n".join(
        f"### {name}\n\n{machine.act('get_machine_summary', {}).text}"
        for name, machine in machines.items()
    )
    opening = session.pack.say(
        "assemble", task=session.task.name, overall=plan.overall, sub_structures=parts
    )
    dialogue = Dialogue(session, phase="assemble", opening=opening)
    builder, guidance = _builder(session, assembly, ASSEMBLE), _guidance(session)
    _alternate(dialogue, (builder, guidance), ends=guidance, what="assembling")
    return assembly


def solo_phase(session: Session) -> Machine:
    """Lets one role design and build alone."""
    pack, task = session.pack, session.task
    machine = Machine()
    session.machine = machine
    opening = pack.say(
        "build_solo",
        task=task.name,
        statement=session.statement,
        modules=modules_text(task.constraints.modules),
    )
    dialogue = Dialogue(session, phase="build", opening=opening)
    role = Role(
        name="builder",
        system=pack.roles["solo"],
        tools=[*tools_named(BUILD), OBJECTION],
        act=acting_on(machine),
    )
    _alternate(dialogue, (role,), ends=role, what="building")
    return machine


def _builder(session: Session, machine: Machine, names: Sequence[str]) -> Role:
    return Role(
        name="builder",
        system=session.pack.roles["builder"],
        tools=tools_named(names),
        act=acting_on(machine),
    )


def _guidance(session: Session) -> Role:
    return Role(name="guidance", system=session.pack.roles["guidance"], tools=[OBJECTION])


def _alternate(dialogue: Dialogue, roles: Sequence[Role], *, ends: Role, what: str) -> None:
    for turn in range(BUILD_TURNS):
        role = roles[turn % len(roles)]
        reply = dialogue.turn(role)
        if role is ends and not reply.calls and TERMINATE.search(reply.text):
            return
    raise ConstructionFailedError("turn_limit", f"{what} took more than {BUILD_TURNS} turns")
