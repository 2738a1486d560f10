"""Who the service takes a caller for: what a page needs to know to offer only what it may do."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from buildarena_api.access import SCOPES, CallerDep
from buildarena_api.dependencies import ContextDep

router = APIRouter(prefix="/v1/caller", tags=["keys"])


class CallerView(BaseModel):
    """Who asks, and what they may do."""

    key_id: str | None = Field(
        description="Of the API key; null for the operator, and where no keys are asked for"
    )
    scopes: list[Literal["read", "submit", "admin"]] = Field(
        description="What the key may do: each includes those before it"
    )
    keys_required: bool = Field(description="Whether requests need an API key")


@router.get("")
async def show_caller(caller: CallerDep, context: ContextDep, response: Response) -> CallerView:
    """Returns the authenticated caller and its scopes."""
    # Another key has another answer, at the same address.
    response.headers["Cache-Control"] = "no-store"
    return CallerView.model_validate(
        {
            "key_id": caller.key_id,
            "scopes": SCOPES[: SCOPES.index(caller.scope) + 1],
            "keys_required": context.settings.require_keys,
        }
    )
