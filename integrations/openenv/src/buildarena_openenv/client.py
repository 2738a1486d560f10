"""The client: a session of its own for each connection."""

from __future__ import annotations

from typing import Any

from openenv.core.client_types import StepResult
from openenv.core.env_client import EnvClient

from buildarena_openenv.models import BuildAction, BuildObservation, BuildState


class BuildClient(EnvClient[BuildAction, BuildObservation, BuildState]):
    """Plays episodes on a server; `.sync()` gives the same without `await`.

    `reset` takes `task`, `seed`, `rounds` and `steps`.
    """

    def _step_payload(self, action: BuildAction) -> dict[str, Any]:
        return action.model_dump()

    def _parse_result(self, payload: dict[str, Any]) -> StepResult[BuildObservation]:
        observation = BuildObservation(
            **payload["observation"], done=payload["done"], reward=payload["reward"]
        )
        return StepResult(observation=observation, reward=payload["reward"], done=payload["done"])

    def _parse_state(self, payload: dict[str, Any]) -> BuildState:
        return BuildState(**payload)
