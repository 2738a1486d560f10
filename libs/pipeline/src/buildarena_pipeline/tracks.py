"""Tracks: workflow x simulator x prompt version. Only results of one track share a ranking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from buildarena_geometry import FEEDBACK_VERSION
from buildarena_pipeline.prompt_packs import load_pack
from buildarena_simulation import ENGINES, SIMULATION_VERSION

WORKFLOWS = ("five-role", "guidance-builder", "builder")
"""Built-in workflows; the construct worker holds their classes."""

SIMULATORS = tuple(ENGINES)
"""Simulators that jobs can name; each has a queue of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """What results must share to be compared.

    Attributes:
        workflow: Workflow name.
        simulator: Simulator name.
        simulation_version: Version of the physics.
        prompts: Prompt pack name.
        prompts_digest: Hash of the pack.
        feedback_version: Version of the words in which geometry answers a model.
    """

    workflow: str
    simulator: str
    simulation_version: str
    prompts: str
    prompts_digest: str
    feedback_version: str

    @property
    def id(self) -> str:
        """A short spelling that holds everything."""
        return (
            f"{self.workflow}/{self.simulator}-{self.simulation_version}/"
            f"{self.prompts}-{self.prompts_digest[:8]}-{self.feedback_version}"
        )

    def as_config(self) -> Mapping[str, Any]:
        """The parts as a JSON object."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def make_track(workflow: str, simulator: str, prompts: str) -> Track:
    """The track of a submission, with the versions that are installed now."""
    return Track(
        workflow=workflow,
        simulator=simulator,
        simulation_version=SIMULATION_VERSION,
        prompts=prompts,
        prompts_digest=load_pack(prompts).digest,
        feedback_version=FEEDBACK_VERSION,
    )
