"""Who the service takes a caller for: what a page needs to know to offer only what it may do."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from buildarena_api.access import CallerDep
from buildarena_api.dependencies import ContextDep
from buildarena_api.http.problems import problem_responses

router = APIRouter(prefix="/v1/caller", tags=["keys"])


class CallerView(BaseModel):
    """Who asks, and what they may do."""

    key: str | None = Field(
        description="Id of the API key; null for the operator, and where no keys are asked for"
    )
    scope: Literal["read", "submit", "admin"] = Field(
        description="The greatest that the key has; it includes those before it"
    )
    keys_required: bool = Field(description="Whether requests need an API key")


@router.get("", responses=problem_responses(503))
async def show_caller(caller: CallerDep, context: ContextDep, response: Response) -> CallerView:
    """Says who the caller is taken for."""
    # Another key has another answer, at the same address.
    response.headers["Cache-Control"] = "no-store"
    return CallerView.model_validate(
        {
            "key": caller.key_id,
            "scope": caller.scope,
            "keys_required": context.settings.require_keys,
        }
    )
