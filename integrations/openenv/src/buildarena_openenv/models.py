"""What client and server send each other."""

from __future__ import annotations

import json
from typing import Any, Final

from openenv.core.env_server.types import Action, Observation, State
from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from buildarena_environment import LONGEST_CALL

MAX_NAME: Final = 100


class BuildAction(Action):
    """A call of one of the tools that `reset` lists; `submit` has the machine simulated."""

    tool: str = Field(max_length=MAX_NAME, description="Name of the tool")
    arguments: dict[str, Any] = Field(
        default_factory=dict, description="Its arguments, with `machine` among them"
    )

    @field_validator("arguments", "metadata")
    @classmethod
    def _bounded(cls, value: dict[str, Any]) -> dict[str, Any]:
        size = len(json.dumps(value, default=str))
        if size > LONGEST_CALL:
            raise PydanticCustomError(
                "too_large",
                "as JSON it has {size} characters: at most {most} are read",
                {"size": size, "most": LONGEST_CALL},
            )
        return value


class BuildObservation(Observation):
    """What a model reads, and what came of a call; its reward is what was gained by the call."""

    text: str = Field(default="", description="The briefing, or the answer to a call")
    accepted: bool = Field(default=True, description="Whether the call was carried out")
    truncated: bool = Field(
        default=False, description="Whether the episode ended because its calls are used up"
    )
    tools: list[dict[str, Any]] = Field(
        default_factory=list, description="What may be called; after a reset only"
    )
    score: dict[str, Any] | None = Field(
        default=None, description="Success, indicator, metrics and flags; after a trial only"
    )


class BuildState(State):
    """Where an episode stands."""

    task: str = Field(default="", description="Name of the task")
    simulator: str = Field(default="", description="Name of the engine that tries machines")
    start_seed: int | None = Field(default=None, description="None for the exact start")
    worth: float = Field(default=0.0, description="What the episode is worth so far")
    steps_left: int = Field(default=0, description="Calls that it may still have")
    done: bool = Field(default=False, description="Whether it has ended")
    machines: dict[str, int] = Field(
        default_factory=dict, description="Parts of each machine, by name"
    )
