"""Example constructions for one-shot prompting."""

from __future__ import annotations

from buildarena_benchmark import Task
from buildarena_pipeline.catalog.prompt_packs import PromptPack
from buildarena_worker.builtin.designs import DESIGNS

EXAMPLE_SEED = 0
ALIKE = {
    "transport": "transport-1",
    "support": "support-1",
    "thrust": "lift-1",
    "height": "lift-2",
    "road": "mechanisms-1",
    "slalom": "mechanisms-1",
    "winch": "mechanisms-3",
    "place": "mechanisms-4",
    "hover": "flight-1",
    "glide": "flight-2",
}
"""By scorer: the built-in task with an example of the kind."""


def example_for(task: Task, pack: PromptPack) -> str:
    """An example of the task's kind: the expert's design for the first level of its category.

    A task of a category of its own gets the example of the category that is scored like it.
    """
    name = f"{task.category}-1"
    if name not in DESIGNS:
        name = ALIKE[task.scorer]
    part = next(iter(DESIGNS[name](EXAMPLE_SEED).parts.values()))
    actions = "\n".join(
        f"{number}. {action}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"
        for number, (action, arguments) in enumerate(part.actions, start=1)
    )
    return pack.say("example", example_task=name, actions=actions)
