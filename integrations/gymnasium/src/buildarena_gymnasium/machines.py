"""The machines that are driven: the built-in expert's, without its programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from buildarena_benchmark.environment import UnknownChoiceError
from buildarena_geometry import Machine


@cache
def fixed_machines() -> Mapping[str, Any]:
    """Documents of the machines by task, in the order of the tasks."""
    text = files(__package__).joinpath("machines.json").read_text(encoding="utf-8")
    return MappingProxyType(json.loads(text)["machines"])


def fixed_machine(task: str) -> Machine:
    """The machine for a task.

    Raises:
        UnknownChoiceError: There is none.
    """
    documents = fixed_machines()
    if task not in documents:
        raise UnknownChoiceError("machine to be driven in task", task, documents)
    return Machine.from_document(documents[task])
