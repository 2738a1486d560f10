"""Tracks: workflow x simulator x prompt version. Only results of one track share a ranking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from buildarena_backend.catalog.specs import (
    STANDARD_MAX_COST_USD,
    STANDARD_MAX_REQUESTS,
)
from buildarena_geometry import FEEDBACK_VERSION

EXTERNAL_WORKFLOW = "external"
"""Workflow of external agents: their own."""
FILE_WORKFLOW = "file"
"""Workflow of machines that were built elsewhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """Settings that results must share to be compared.

    Attributes:
        simulation_version: Version of our physics, or of the game and its mod.
        prompts: Prompt pack name.
        prompts_digest: Hash of the pack.
        feedback_version: Version of the words in which geometry answers a model.
        workflow_digest: Hash of an operator's own workflow; "" for built-in ones.
        one_shot: Whether an example construction is shown.
        rounds: Rounds of the closed loop; 1 without one.
        analyst: Whether an analyst advises between rounds.
        on_demand: Whether roles look modules up instead of being given them.
        data_sheets: Whether roles are given the numbers of modules and world.
        worlds: Varied worlds in which a finished machine is scored, besides the exact one.
        paper: Whether it follows the paper's protocol, see `is_paper`.
    """

    workflow: str
    simulator: str
    simulation_version: str
    prompts: str
    prompts_digest: str
    feedback_version: str = FEEDBACK_VERSION
    workflow_digest: str = ""
    one_shot: bool = False
    rounds: int = 1
    analyst: bool = False
    on_demand: bool = False
    data_sheets: bool = False
    worlds: int = 0
    paper: bool = False

    @property
    def id(self) -> str:
        """A short spelling that holds everything."""
        workflow = self.workflow
        if self.workflow_digest:
            workflow += f"-{self.workflow_digest[:8]}"
        if self.one_shot:
            workflow += "+one-shot"
        if self.on_demand:
            workflow += "+looked-up"
        if self.data_sheets:
            workflow += "+data-sheets"
        if self.rounds > 1:
            workflow += f"+{self.rounds}-rounds" + ("-analyst" if self.analyst else "")
        if self.worlds:
            workflow += f"+{self.worlds}-worlds"
        if self.paper:
            workflow += "+paper"
        return (
            f"{workflow}/{self.simulator}-{self.simulation_version}/"
            f"{self.prompts}-{self.prompts_digest[:8]}-{self.feedback_version}"
        )

    def as_config(self) -> Mapping[str, Any]:
        """Return the parts as a JSON object."""
        parts = {name: getattr(self, name) for name in self.__dataclass_fields__}
        # Rows have the older word; tracks from before modules could be looked up say nothing of it,
        # nor do those from before data sheets, which had none, and from before varied worlds.
        optional = {
            "data_sheets": parts.pop("data_sheets"),
            "looked_up": parts.pop("on_demand"),
            "worlds": parts.pop("worlds"),
            "paper": parts.pop("paper"),
        }
        return {**parts, **{name: value for name, value in optional.items() if value}}


def has_data_sheets(config: Mapping[str, Any]) -> bool:
    """Return whether a track shows the numbers of modules and world; older ones do not."""
    return bool(config.get("data_sheets"))


def worlds_of(config: Mapping[str, Any]) -> int:
    """Return the number of varied worlds in which a track scores machines; 0 of older ones."""
    return int(config.get("worlds", 0))


def is_paper(config: Mapping[str, Any]) -> bool:
    """Return whether a track follows the paper's protocol.

    It has the paper's nine tasks in the exact world alone, without test trials and with the limits
    of the workflow's turns alone; trials that the paper calls hacked are left out.
    """
    return bool(config.get("paper"))


def session_limits(config: Mapping[str, Any], own: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return all limits of a job's session, by name.

    Args:
        config: The track's result of `Track.as_config`.
        own: Limits set by its owner, below those of the protocol.
    """
    if is_paper(config):
        return own
    standard = {"max_requests": STANDARD_MAX_REQUESTS, "max_cost_usd": STANDARD_MAX_COST_USD}
    return {**standard, **own}


def default_track(ended: Mapping[str, int], standard: str) -> str | None:
    """Return the default track of a board; None if no job has ended.

    Args:
        standard: The track of a sweep that names nothing but tasks and models.
    """
    if standard in ended:
        return standard
    return min(ended, key=lambda track: (-ended[track], track), default=None)
