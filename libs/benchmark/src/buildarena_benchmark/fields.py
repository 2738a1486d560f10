"""Fields that several models of the task file share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
Threshold = Annotated[float, Field(ge=0, le=1e6)]
Count = Annotated[int, Field(ge=0, le=1000)]


class Document(BaseModel):
    """A part of a task file: unknown fields are refused, with their names."""

    model_config = ConfigDict(frozen=True, extra="forbid")
