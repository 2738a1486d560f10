"""The geometry library's actions as tools of a role."""

from collections.abc import Sequence

from buildarena_benchmark import Task
from buildarena_benchmark.environment.briefing import describe_modules
from buildarena_benchmark.environment.tools import LOOKUPS
from buildarena_benchmark.environment.trials.world import units_text
from buildarena_geometry import GROUPS, LOOKUP, ToolDefinition, modules_named, tool_definitions
from buildarena_geometry.feedback.modules import lookup_text, module_in_short, modules_text
from buildarena_geometry.feedback.modules import modules_in_short as catalogue_in_short
from buildarena_worker.session.session import Session

QUERIES = ("get_machine_summary", "get_block_details")
REFINE = ("twist_block", "shift_block", "flip_spin", *QUERIES)
BUILD = ("start", "attach_block_to", "connect_blocks", "remove_block", "reset", *REFINE)
REPAIR = ("change_control_key", "review_powered_blocks", "review_control_config")
"""Additional tools for a machine with keys that a task gives."""
ALONE = ("mirror", "build")
"""Additional tools for a role that builds without a guide."""
MACHINES = ("add_machine", "shift_machine", "rotate_machine", "remove_machine")
JOIN = ("connect_blocks", "attach_block_to", "remove_block")
ASSEMBLE = (*MACHINES, *JOIN, *REFINE)


def building(task: Task) -> Sequence[str]:
    """Return the names of a builder's tools."""
    return BUILD if task.initial_machine is None else (*BUILD, *REPAIR)


def tools_named(names: Sequence[str]) -> list[ToolDefinition]:
    """Return the library's tool definitions with these names, in this order."""
    tools = {tool.name: tool for tool in tool_definitions((*GROUPS, LOOKUP))}
    return [tools[name] for name in names]


def lookups(task: Task) -> list[ToolDefinition]:
    """Return the tools to look up modules; none if prompts describe all modules."""
    return tools_named(LOOKUPS) if task.constraints.on_demand else []


def modules_of(session: Session) -> str:
    """Return the text about the modules of a session's task, or about how to look them up."""
    return describe_modules(session.task, data_sheets=session.data_sheets)


def planned_modules(session: Session, plan: str) -> str:
    """Describe the modules that a plan names, or all if it names none, and the connectors."""
    task, catalogue = session.task, session.catalogue
    if task.constraints.on_demand:
        return modules_of(session)
    named = _find_modules(plan, task)
    short = [module_in_short(catalogue[n]) for n in connectors_of(task) if n not in named]
    units = [f"\n{units_text(catalogue, session.task)}"] if session.data_sheets else []
    return "\n".join([modules_text(catalogue, named), *short, *units])


def parts_of(task: Task, plan: str) -> str:
    """Return a short form of it: sizes, masses and actions, without descriptions and data."""
    limits = task.constraints
    if limits.on_demand:
        return lookup_text(limits.catalogue)
    named = (*_find_modules(plan, task), *connectors_of(task))
    return catalogue_in_short(limits.catalogue, named)


def _find_modules(plan: str, task: Task) -> Sequence[str]:
    """Return the task's modules that a plan names, in any case; all if it names none."""
    offered, written = modules_named(task.constraints.modules), plan.casefold()
    named = set()
    # A long name may contain a short one.
    for name in sorted(offered, key=len, reverse=True):
        if name.casefold() in written:
            named.add(name)
            written = written.replace(name.casefold(), "\0")
    return [name for name in offered if name in named] or offered


def connectors_of(task: Task) -> list[str]:
    """Return the names of the connectors among a task's modules."""
    allowed = modules_named(task.constraints.modules)
    return [name for name in task.constraints.catalogue.connectors if name in allowed]


def tools_text(names: Sequence[str]) -> str:
    """Return the descriptions of tools, for a role without them, one line each."""
    return "\n".join(f"- {tool.name}: {tool.description}" for tool in tools_named(names))
