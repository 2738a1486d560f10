"""Example constructions for one-shot prompting."""

from __future__ import annotations

from buildarena_backend.catalog.prompt_packs import PromptPack
from buildarena_benchmark import Task, builtin_tasks
from buildarena_worker.builtin.designs import DESIGNS

EXAMPLE_SEED = 0


def example_for(task: Task, pack: PromptPack) -> str:
    """An example of the task's kind: the expert's design for the first level of its category.

    A task of a category of its own gets the example of the first other task that is scored like it,
    and the first example of all if none is.
    """
    name = f"{task.category}-1"
    if name not in DESIGNS:
        others = [name for name in DESIGNS if name != task.name]
        alike = [name for name in others if builtin_tasks()[name].scorer == task.scorer]
        name = next(iter(alike or DESIGNS))
    part = next(iter(DESIGNS[name](EXAMPLE_SEED).parts.values()))
    actions = "\n".join(
        f"{number}. {action}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"
        for number, (action, arguments) in enumerate(part.actions, start=1)
    )
    return pack.say("example", example_task=name, actions=actions)
