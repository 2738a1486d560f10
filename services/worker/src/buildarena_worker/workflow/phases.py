"""Phases, and the built-in workflows: five roles, guidance and builder, or the builder alone."""

import re
from collections.abc import Mapping, Sequence

from buildarena_benchmark import broken_constraint
from buildarena_benchmark.environment.edit_limit import limit_edits
from buildarena_benchmark.environment.tools import LOOKUPS, OBJECTION
from buildarena_geometry import Machine, ToolDefinition
from buildarena_worker.session.dialogue import Dialogue, Role, is_lookup_only, terminates
from buildarena_worker.session.messages import Completion
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.machine_tools import (
    ALONE,
    ASSEMBLE,
    REFINE,
    building,
    connectors_of,
    lookups,
    modules_of,
    parts_of,
    planned_modules,
    tools_named,
    tools_text,
)
from buildarena_worker.workflow.plan import Plan, PlanError, SubStructure, parse_plan

PLAN_TURNS = 5
"""Answers allowed until the plan can be read."""
DRAFT_TURNS = 50
BUILD_TURNS = 300
"""Replies a phase may take. Source: the paper's workflow appendix."""
MAX_LOOKUPS = 20
"""Modules a role may look up before it speaks."""
MAX_STEPS = 10
"""Steps that guidance may give at a time."""
_STEP = re.compile(r"^\s*\d+[.)]\s+\S", re.MULTILINE)
SHOWN = 200
"""Characters of a reply that a failure quotes."""


def plan_phase(session: Session) -> Plan:
    """Let the planner write a plan, with as many sub-structures as the task allows.

    Raises:
        ConstructionFailedError: No usable plan within the turns.
    """
    limits = session.task.constraints
    opening = session.say("plan", statement=session.statement, modules=modules_of(session))
    dialogue = Dialogue(session, phase="plan", opening=opening)
    planner = _designer(session, "planner")
    error = PlanError("nothing was said")
    for _ in range(PLAN_TURNS):
        text = speak(dialogue, planner).text
        try:
            plan = parse_plan(text)
            _check_plan(plan, limits.min_sub_structures, limits.max_sub_structures)
        except PlanError as unusable:
            error = unusable
            dialogue.remark(planner, session.say("plan_again", error=str(error)))
        else:
            session.plan = plan.text
            return plan
    reason = "constraint_violated" if isinstance(error, _PlanNotAllowedError) else "plan_unreadable"
    raise ConstructionFailedError(reason, f"{error}; the planner said {text[:SHOWN]!r}")


class _PlanNotAllowedError(PlanError):
    """A plan that can be read and that the task does not allow."""


def _check_plan(plan: Plan, minimum: int, maximum: int) -> None:
    count = len(plan.sub_structures)
    if not minimum <= count <= maximum:
        allowed = str(maximum) if minimum == maximum else f"{minimum} to {maximum}"
        raise _PlanNotAllowedError(
            f"the plan has {count} sub-structures, the task allows {allowed}"
        )


def draft_phase(session: Session, plan: Plan, part: SubStructure) -> str:
    """Let drafter and reviewer alternate, and return the drafter's final drawing.

    Raises:
        ConstructionFailedError: An objection, or no agreement within the turn limit.
    """
    opening = session.say(
        "draft",
        statement=session.statement,
        modules=planned_modules(session, f"{plan.text}\n{part.text}"),
        plan=plan.text,
        name=part.name,
        sub_structure=part.text,
    )
    dialogue = Dialogue(session, phase="draft", opening=opening, sub_structure=part.name)
    drafter = _designer(session, "drafter")
    reviewer = _designer(session, "reviewer", [OBJECTION])
    for turn in range(DRAFT_TURNS):
        if turn % 2 == 0:
            speak(dialogue, drafter)
        elif terminates(speak(dialogue, reviewer)):
            dialogue.remark(drafter, session.say("blueprint", name=part.name))
            return speak(dialogue, drafter).text
    raise ConstructionFailedError(
        "turn_limit", f"no agreed drawing of {part.name} within {DRAFT_TURNS} turns"
    )


def build_phase(
    session: Session, part: SubStructure, blueprint: str, *, modules: str | None = None
) -> Machine:
    """Let builder and guidance alternate, the builder first, until guidance ends it.

    Args:
        blueprint: Drawing that guidance reads.
        modules: Module list that guidance reads; by default the short form of the drawing's.

    Raises:
        ConstructionFailedError: An objection, or the turn limit.
    """
    task, machine = session.task, session.new_machine()
    opening = session.say("build", name=part.name)
    brief = session.say(
        "guide_build",
        name=part.name,
        blueprint=blueprint,
        modules=modules or parts_of(task, f"{part.text}\n{blueprint}"),
        tools=tools_text(building(task)),
    )
    dialogue = Dialogue(session, phase="build", opening=opening, sub_structure=part.name)
    builder = _builder(session, machine, building(task))
    guidance = _designer(session, "guidance", [OBJECTION], brief)
    _alternate(dialogue, (builder, guidance), ends=guidance, subject=f"building {part.name}")
    return machine


def refine_phase(session: Session, machine: Machine, part: SubStructure, blueprint: str) -> Machine:
    """Let guidance and builder correct powered parts, when the machine has wheels.

    They work on a copy, which is discarded after an objection, the turn limit, or a correction that
    the task's rules do not allow.
    """
    if not any(block.module.spins for block in machine.blocks.values()):
        return machine
    task = session.task
    refined = machine.copy()
    summary = machine.act("get_machine_summary", {}).text
    opening = session.say("refine", name=part.name, summary=summary)
    brief = session.say(
        "guide_refine",
        name=part.name,
        blueprint=blueprint,
        summary=summary,
        modules=parts_of(task, f"{part.text}\n{blueprint}"),
        tools=tools_text(REFINE),
    )
    dialogue = Dialogue(session, phase="refine", opening=opening, sub_structure=part.name)
    builder = _builder(session, refined, REFINE)
    guidance = _designer(session, "guidance", [OBJECTION], brief)
    try:
        _alternate(dialogue, (guidance, builder), ends=guidance, subject=f"refining {part.name}")
    except ConstructionFailedError as failure:
        if failure.result.reason not in {"objection", "turn_limit"}:
            raise
        return machine
    if broken_constraint(task, refined) and not broken_constraint(task, machine):
        return machine
    session.machine = refined
    return refined


def assemble_phase(session: Session, plan: Plan, machines: Mapping[str, Machine]) -> Machine:
    """Let builder and guidance put the sub-structures together."""
    assembly = session.new_machine(machines)
    parts = "\n\n".join(
        f"### {name}\n\n{machine.act('get_machine_summary', {}).text}"
        for name, machine in machines.items()
    )
    connectors = ", ".join(connectors_of(session.task))
    opening = session.say("assemble", parts=", ".join(machines), connectors=connectors)
    brief = session.say(
        "guide_assemble",
        statement=session.statement,
        plan=plan.text,
        sub_structures=parts,
        connectors=connectors,
        tools=tools_text(ASSEMBLE),
    )
    dialogue = Dialogue(session, phase="assemble", opening=opening)
    builder = _builder(session, assembly, ASSEMBLE)
    guidance = _designer(session, "guidance", [OBJECTION], brief)
    _alternate(dialogue, (builder, guidance), ends=guidance, subject="assembling")
    return assembly


def _builder(session: Session, machine: Machine, names: Sequence[str]) -> Role:
    return Role(
        name="builder",
        system=session.pack.roles["builder"],
        tools=tools_named(names),
        act=limit_edits(session.task, machine),
        forgets=True,
    )


def _designer(
    session: Session, name: str, tools: Sequence[ToolDefinition] = (), brief: str = ""
) -> Role:
    """Return a role that does not build, with tools to look up modules if the task requires it."""
    return Role(
        name=name,
        system=session.pack.roles[name],
        tools=[*tools, *lookups(session.task)],
        act=Machine(catalogue=session.catalogue).act,
        brief=brief,
    )


def speak(dialogue: Dialogue, role: Role) -> Completion:
    """Return a role's first reply that does not only look up modules."""
    reply = dialogue.turn(role)
    may_look = any(tool.name in LOOKUPS for tool in role.tools)
    for _ in range(MAX_LOOKUPS if may_look else 0):
        if not is_lookup_only(reply):
            break
        reply = dialogue.turn(role)
    return reply


def _alternate(dialogue: Dialogue, roles: Sequence[Role], *, ends: Role, subject: str) -> None:
    """Let roles speak in turn until one ends the phase.

    A role that reads numbered steps takes a turn for each; when one is refused, or it calls no
    tool, the other role is next.
    """
    place, steps = 0, 0
    for _ in range(BUILD_TURNS):
        role = roles[place]
        reply = speak(dialogue, role)
        if role is ends:
            if terminates(reply):
                return
            steps = steps_in(reply.text)
        else:
            steps = steps - 1 if dialogue.acted else 0
        if role is ends or steps <= 0:
            place = (place + 1) % len(roles)
    raise ConstructionFailedError("turn_limit", f"{subject} took more than {BUILD_TURNS} turns")


def steps_in(text: str) -> int:
    """Return the number of numbered lines in a role's steps, at least one."""
    return max(1, min(len(_STEP.findall(text)), MAX_STEPS))


class FiveRole:
    """Plan, then draft, build and refine each sub-structure, then assemble.

    Source: the paper's section on the agentic workflow.
    """

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task."""
        plan = plan_phase(session)
        machines: dict[str, Machine] = {}
        for part in plan.sub_structures:
            blueprint = draft_phase(session, plan, part)
            machine = build_phase(session, part, blueprint)
            if not machine.started:
                raise ConstructionFailedError("empty_machine", "no machine was started")
            machines[part.name] = refine_phase(session, machine, part, blueprint)
        if len(machines) == 1:
            return next(iter(machines.values()))
        return assemble_phase(session, plan, machines)


class GuidanceBuilder:
    """Guidance designs step by step and the builder acts, without a plan.

    Source: the paper's ablation.
    """

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task as one structure."""
        brief = session.say("no_drawing", statement=session.statement)
        part = SubStructure(name="machine", text=brief)
        modules = modules_of(session)
        machine = build_phase(session, part, brief, modules=modules)
        return refine_phase(session, machine, part, brief)


class Builder:
    """One role with all tools designs and builds. Source: the paper's ablation."""

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task as one structure."""
        task, machine = session.task, session.new_machine()
        opening = session.say(
            "build_solo", statement=session.statement, modules=modules_of(session)
        )
        dialogue = Dialogue(session, phase="build", opening=opening)
        role = Role(
            name="builder",
            system=session.pack.roles["solo"],
            tools=[*tools_named((*building(task), *ALONE)), *lookups(task), OBJECTION],
            act=limit_edits(session.task, machine),
        )
        _alternate(dialogue, (role,), ends=role, subject="building")
        return machine
