"""The workflows by name: the built-in ones, and an operator's from files or modules.

The API lists them without the worker's package; the worker loads each from its `place`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from buildarena_backend.errors import StartupError


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkflowSource:
    """Location of a workflow's class.

    Attributes:
        place: ``module`` or ``path/to/file.py``.
        digest: Hash of the file, part of the track; "" for installed modules.
        one_structure: Whether it builds one structure and never puts several together.
    """

    name: str
    place: str
    class_name: str
    digest: str = ""
    one_structure: bool = False


_BUILTIN: Final = "buildarena_worker.workflow.phases"
BUILTIN: Final = (
    WorkflowSource(name="five-role", place=_BUILTIN, class_name="FiveRole"),
    WorkflowSource(
        name="guidance-builder", place=_BUILTIN, class_name="GuidanceBuilder", one_structure=True
    ),
    WorkflowSource(name="builder", place=_BUILTIN, class_name="Builder", one_structure=True),
)
DEFAULT_WORKFLOW: Final = BUILTIN[0].name


def workflow_sources(settings: Mapping[str, str]) -> dict[str, WorkflowSource]:
    """Return all workflows by name.

    Args:
        settings: Operator's workflows: name to ``module:Class`` or ``path/to/file.py:Class``.

    Raises:
        StartupError: An entry can't be used; the message names it.
    """
    sources = {source.name: source for source in BUILTIN}
    for name, target in settings.items():
        place, colon, class_name = target.rpartition(":")
        if not colon or not place or not class_name.isidentifier():
            raise StartupError(
                f"workflow {name!r}: {target!r} is neither module:Class nor path/to/file.py:Class"
            )
        digest = ""
        if place.endswith(".py"):
            try:
                digest = hashlib.sha256(Path(place).read_bytes()).hexdigest()
            except OSError as error:
                raise StartupError(f"workflow {name!r}: {place}: {error.strerror}") from error
        sources[name] = WorkflowSource(name=name, place=place, class_name=class_name, digest=digest)
    return sources
