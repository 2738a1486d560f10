"""What a drive's process and its owner tell each other.

Frames are bytes: a little-endian float32, the time in seconds; a uint32, the number of the last
change of keys that has acted; then a float32 row of 7 per block, in the order of the scene's
blocks: position (units) and quaternion (w, x, y, z), world frame; a cargo is one more row. All else
is JSON.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.scenes import SceneView
from buildarena_geometry import KEYS
from buildarena_pipeline.catalog.specs import Name
from buildarena_simulation import DEFAULT_ENGINE

FRAME, NEWS = b"F", b"J"
"""What a message of the process begins with: a frame, or JSON."""
HEAD: Final = struct.Struct("<fI")
Why = Literal["time", "stopped", "lost", "blown_up", "too_long", "too_many_presses", "failed"]


class Hello(BaseModel):
    """What a driver asks for, first of all."""

    model_config = ConfigDict(extra="forbid")

    key: str | None = Field(default=None, max_length=200)
    machine: dict[str, Any] = Field(description="A machine document")
    task: Name | None = Field(default=None, description="None for free ground")
    simulator: Name = DEFAULT_ENGINE
    driver: str | None = Field(
        default=None, max_length=80, description="Its name on the leaderboard; None for practice"
    )


class Keys(BaseModel):
    """Which keys are held from now on."""

    model_config = ConfigDict(extra="forbid")

    held: Annotated[list[Literal[KEYS]], Field(max_length=len(KEYS))] = []  # type: ignore[valid-type]
    number: Annotated[int, Field(ge=0, lt=2**32)] = 0
    end: bool = Field(default=False, description="Whether the drive ends with it")


class PressView(BaseModel):
    """A key that was held."""

    time_s: float
    key: str
    hold_for_s: float


class Ready(BaseModel):
    """The machine stands there; time begins with the first key."""

    type: Literal["ready"] = "ready"
    scene: SceneView
    keys: dict[str, list[str]] = Field(description="By key, the actions that it is bound to")
    duration_s: float
    job: str | None = None


class Broke(BaseModel):
    """Joints that broke."""

    type: Literal["broke"] = "broke"
    joints: list[str]
    time_s: float


class Ended(BaseModel):
    """The drive is over."""

    type: Literal["ended"] = "ended"
    why: Why
    detail: str = ""
    time_s: float
    presses: list[PressView]
    job: str | None = None


class Refused(BaseModel):
    """The machine cannot be driven."""

    type: Literal["refused"] = "refused"
    detail: str
