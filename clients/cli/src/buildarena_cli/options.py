"""Options that many commands share."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from buildarena_pipeline.runtime.settings import DEFAULT_PORT

DEFAULT_URL = f"http://127.0.0.1:{DEFAULT_PORT}"

UrlOption = Annotated[str, typer.Option("--url", envvar="BUILDARENA_URL", help="Where the API is.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
MaxCostOption = Annotated[
    float | None, typer.Option("--max-cost-usd", help="Budget in US dollars.", min=0)
]
MaxTokensOption = Annotated[
    int | None, typer.Option("--max-tokens", help="Budget in tokens, in and out.", min=1)
]
MaxRequestsOption = Annotated[
    int | None, typer.Option("--max-requests", help="Budget in model requests.", min=1)
]


def budget_of(
    max_cost_usd: float | None, max_tokens: int | None, max_requests: int | None
) -> dict[str, Any] | None:
    """The budget that options name; None when they name none."""
    given = {
        "max_cost_usd": max_cost_usd,
        "max_tokens": max_tokens,
        "max_requests": max_requests,
    }
    return {name: value for name, value in given.items() if value is not None} or None
