"""What every answer says of the scoring policy that it was made under."""

from __future__ import annotations

from pydantic import BaseModel, Field

from buildarena_benchmark.flags import ScoringPolicy


class UnderPolicy(BaseModel):
    """An answer that depends on how flags are read."""

    policy: ScoringPolicy = Field(description="The scoring policy: how flags were read")
