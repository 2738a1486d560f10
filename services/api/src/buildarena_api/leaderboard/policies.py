"""What every answer says of the scoring policy that it was made under."""

from __future__ import annotations

from pydantic import BaseModel, Field, computed_field

from buildarena_benchmark.flags import ScoringPolicy


class UnderPolicy(BaseModel):
    """An answer that depends on how flags are read."""

    policy: ScoringPolicy = Field(description="The scoring policy: how flags were read")

    @computed_field(  # type: ignore[prop-decorator] # pydantic's form
        description="Former name of `policy`", json_schema_extra={"deprecated": True}
    )
    @property
    def reading(self) -> ScoringPolicy:
        """Former name of `policy`, for one release."""
        return self.policy
