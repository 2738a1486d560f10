"""Example constructions for one-shot prompting."""

from __future__ import annotations

from buildarena_benchmark import Task
from buildarena_pipeline.errors import PermanentFaultError
from buildarena_pipeline.prompt_packs import PromptPack
from buildarena_worker.builtin.designs import DESIGNS

EXAMPLE_SEED = 0


def example_for(task: Task, pack: PromptPack) -> str:
    """An example of the task's category: the expert's design for its first level.

    Raises:
        PermanentFaultError: There is no example for the category.
    """
    name = f"{task.category}-1"
    if name not in DESIGNS:
        raise PermanentFaultError(
            f"no example construction for the category {task.category!r}; there are examples for "
            f"{', '.join(sorted({known.rsplit('-', 1)[0] for known in DESIGNS}))}",
            reason="no_example",
        )
    part = next(iter(DESIGNS[name](EXAMPLE_SEED).parts.values()))
    actions = "\n".join(
        f"{number}. {action}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"
        for number, (action, arguments) in enumerate(part.actions, start=1)
    )
    return pack.say("example", example_task=name, actions=actions)
