"""Arguments of the wrong form are refused alike by every tool, and end nothing."""

from dataclasses import replace
from typing import Any

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import Environment
from buildarena_benchmark.environment import call as play
from buildarena_benchmark.environment.tools import SUBMIT, building_tools
from buildarena_geometry import Machine, ToolDefinition
from buildarena_worker.workflow.analyst import LOOKS, _make_act


class NoTrajectory:
    """A session whose trial had none."""

    class host:  # noqa: N801 - an attribute of sessions
        trajectory = staticmethod(lambda _: None)

    class transcript:  # noqa: N801 - an attribute of sessions
        turns = ()


def malformed(tool: ToolDefinition) -> list[Any]:
    """Arguments that are no object, unknown, missing, or of another type than a tool takes."""
    properties, required = tool.parameters["properties"], tool.parameters.get("required", [])
    wrong = {"string": ["x"], "array": "x", "number": "x", "integer": "x"}
    fitting = {"string": "1", "array": [0, 0, 0], "number": 1, "integer": 1}
    good = {name: fitting[properties[name]["type"]] for name in required}
    cases: list[Any] = ["text that is no JSON", [], 3, {**good, "unheard_of": 1}]
    cases += [{k: v for k, v in good.items() if k != name} for name in required]
    cases += [{**good, name: wrong[properties[name]["type"]]} for name in properties]
    return cases


def test_every_tool_refuses_malformed_arguments_alike(subtests) -> None:
    tools = building_tools()
    known = {"build", "mirror", "start", "set_controller", "test_controller"}
    assert known <= {tool.name for tool in tools}
    for tool in (*tools, SUBMIT):
        task = builtin_tasks()["landing-2" if "controller" in tool.name else "support-2"]
        if "module" in tool.name:
            listed = task.constraints.model_copy(update={"module_list": "on_demand"})
            task = replace(task, constraints=listed)
        environment = Environment(task)
        play(environment, "start", {"machine": "other"})
        for arguments in malformed(tool):
            with subtests.test(tool=tool.name, arguments=arguments):
                answer = play(environment, tool.name, arguments)
                assert (answer.accepted, answer.terminated, answer.trial) == (False, False, None)
                assert answer.text.endswith(".")
    machine = Machine()
    look = _make_act(NoTrajectory, machine, None)  # type: ignore[arg-type]
    for tool in LOOKS.values():
        for arguments in malformed(tool):
            with subtests.test(tool=tool.name, arguments=arguments):
                outcome = look(tool.name, arguments)
                assert outcome.reason == "malformed_arguments", outcome.text
    assert look("read_breaks", None).ok
