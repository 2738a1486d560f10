"""Numbers and names that several parts of a scenario share, each with its bounds."""

from typing import Annotated, Any, Final

from pydantic import Field

MAX_DURATION_S: Final = 600.0

Coordinate = Annotated[float, Field(allow_inf_nan=False, ge=-1e4, le=1e4)]
Distance = Annotated[float, Field(gt=0, le=1000)]
TerrainExtent = Annotated[float, Field(ge=0.1, le=1000)]
CargoExtent = Annotated[float, Field(ge=0.1, le=100)]
Mass = Annotated[float, Field(ge=0.01, le=100_000)]
Instant = Annotated[float, Field(ge=0, le=MAX_DURATION_S)]
Speed = Annotated[float, Field(allow_inf_nan=False, ge=-200, le=200)]
Swing = Annotated[float, Field(allow_inf_nan=False, ge=-100, le=100)]
Period = Annotated[float, Field(ge=1, le=600)]
PushSpeed = Annotated[float, Field(allow_inf_nan=False, ge=-20, le=20)]
Heading = Annotated[float, Field(ge=-180, le=180, exclude_if=lambda value: value == 0)]
Label = Annotated[str, Field(pattern=r"^[\w -]+$", min_length=1, max_length=40)]
Gravity = Annotated[float, Field(ge=5, le=100)]
Strength = Annotated[float, Field(ge=0.1, le=10)]
BlockId = Annotated[str, Field(min_length=1, max_length=40)]


def is_default(value: Any) -> bool:
    """Check if an addition to the format is unused, so that older texts and hashes stay."""
    return value is None or value is False or value in ((), {})
