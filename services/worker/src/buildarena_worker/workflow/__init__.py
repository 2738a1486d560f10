"""Workflows: the order in which roles speak, from the task to the finished machine.

They are found by name: the built-in ones, and an operator's custom ones.
"""

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Protocol

from buildarena_backend.catalog.workflows import WorkflowSource, workflow_sources
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_geometry import Machine
from buildarena_worker.session.session import Session


class Workflow(Protocol):
    """A way to build, which uses only the session, so that it can be replayed."""

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task.

        Raises:
            ConstructionFailedError: The model gave up or broke the rules.
        """


class Workflows:
    """Workflows by name.

    Args:
        custom: Operator's workflows: names and ``module:Class`` or ``path/to/file.py:Class``.

    Raises:
        StartupError: One of them can't be loaded; the message names it.
    """

    def __init__(self, custom: Mapping[str, str]) -> None:
        self._makers = {source.name: _load(source) for source in workflow_sources(custom).values()}

    def find(self, name: str) -> Workflow:
        """Create a workflow by its name.

        Raises:
            PermanentError: This worker does not have it.
        """
        if name not in self._makers:
            raise PermanentError(
                f"unknown workflow {name!r}; valid workflows: {', '.join(self._makers)}",
                reason="unknown_workflow",
            )
        return self._makers[name]()


def _load(source: WorkflowSource) -> Callable[[], Workflow]:
    try:
        maker: Callable[[], Workflow] = getattr(_module(source), source.class_name)
    except Exception as error:
        raise StartupError(
            f"workflow {source.name!r} can't be loaded from {source.place}:{source.class_name}: "
            f"{type(error).__name__}: {error}"
        ) from error
    return maker


def _module(source: WorkflowSource) -> ModuleType:
    if not source.place.endswith(".py"):
        return importlib.import_module(source.place)
    name = f"buildarena_workflow_{source.name.replace('-', '_')}"
    spec = importlib.util.spec_from_file_location(name, Path(source.place))
    if spec is None or spec.loader is None:
        raise ImportError(f"{source.place} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
