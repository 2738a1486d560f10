"""Models that answer by a script, behind Inspect's own mock provider."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from inspect_ai.log import EvalLog, EvalSample, read_eval_log
from inspect_ai.model import ChatMessage, Model, ModelOutput, ModelUsage, get_model

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import Trial, try_machine
from buildarena_benchmark.environment.workbench import Workbench
from buildarena_simulation import DEFAULT_ENGINE

ROOT = Path(__file__).parents[3]
EXPERTS = json.loads((ROOT / "build/expert_calls.json").read_text(encoding="utf-8"))
USAGE = ModelUsage(input_tokens=7, output_tokens=3, total_tokens=10)
Answer = Callable[[list[ChatMessage]], ModelOutput]


def task_in(messages: list[ChatMessage]) -> str:
    """The task that a conversation is about."""
    briefing = next(message.text for message in messages if message.role == "user")
    return briefing.split("# Task: ")[1].split()[0]


def calls_in(messages: list[ChatMessage]) -> int:
    """How many calls a model has made."""
    return sum(len(m.tool_calls or ()) for m in messages if m.role == "assistant")


def call(tool: str, arguments: dict[str, Any]) -> ModelOutput:
    return ModelOutput.for_tool_call("mockllm", tool, arguments)


def expert(messages: list[ChatMessage], late: int = 0) -> ModelOutput:
    """The built-in expert's next call, or `submit`; it begins after so many calls of others."""
    calls, done = EXPERTS[task_in(messages)]["calls"], calls_in(messages) - late
    if done >= len(calls):
        return call("submit", {})
    made = calls[done]
    several = builtin_tasks()[task_in(messages)].constraints.max_sub_structures > 1
    named = {"machine": made["machine"]} if several else {}
    return call(made["tool"], {**made["arguments"], **named})


def scripted(answer: Answer) -> Model:
    """Inspect's mock model with these answers; given their usage, it counts no tokens itself."""

    def answered(messages: list[ChatMessage], *_: object) -> ModelOutput:
        output = answer(messages)
        output.usage = USAGE
        return output

    return get_model("mockllm/model", custom_outputs=answered, memoize=False)


def listed(*outputs: ModelOutput) -> Answer:
    """These answers, by the number of calls or replies so far; the last again and again."""

    def answer(messages: list[ChatMessage]) -> ModelOutput:
        said = sum(message.role == "assistant" for message in messages)
        return outputs[min(said, len(outputs) - 1)].model_copy(deep=True)

    return answer


def tried(name: str, simulator: str = DEFAULT_ENGINE) -> Trial:
    """What the library itself says of the expert's machine for the task of this name."""
    task = builtin_tasks()[name].with_seed(0)
    bench = Workbench(task.constraints.catalogue, task=task)
    for made in EXPERTS[name]["calls"]:
        assert bench.act(made["machine"], made["tool"], made["arguments"]).ok
    return try_machine(task, bench.submitted(), simulator)


def only(log: EvalLog) -> EvalSample:
    """The one sample of a log, as its file has it."""
    (sample,) = read_eval_log(log.location, resolve_attachments="full").samples or ()
    return sample


def answers(sample: EvalSample) -> list[str]:
    """Return the tools' answers to the model, in order."""
    return [message.text for message in sample.messages if message.role == "tool"]
