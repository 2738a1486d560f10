"""Options that many commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.defaults import DEFAULT_URL

__all__ = ["DEFAULT_URL"]

UrlOption = Annotated[str, typer.Option("--url", envvar="BUILDARENA_URL", help="Where the API is.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
DataOption = Annotated[Path | None, typer.Option("--data", help="Folder of databases and logs.")]
PortOption = Annotated[int | None, typer.Option("--port", help="Port of the API.")]
MaxCostOption = Annotated[
    float | None, typer.Option("--max-cost-usd", help="Budget in US dollars.", min=0)
]
MaxTokensOption = Annotated[
    int | None, typer.Option("--max-tokens", help="Budget in tokens, in and out.", min=1)
]
MaxRequestsOption = Annotated[
    int | None, typer.Option("--max-requests", help="Budget in model requests.", min=1)
]

JobId = Annotated[str, typer.Argument(help="Id of the job, or its beginning.")]
SweepId = Annotated[str, typer.Argument(help="Id of the sweep, or its beginning.")]
KeyId = Annotated[str, typer.Argument(help="Id of the key, or its beginning.")]
TaskName = Annotated[str, typer.Argument(help="Task name.")]
ModelName = Annotated[str, typer.Argument(help="Model name.")]
TasksOption = Annotated[list[str] | None, typer.Option("--task", help="Only these tasks.")]
ModelsOption = Annotated[list[str] | None, typer.Option("--model", help="Only these models.")]
TrackOption = Annotated[
    str | None,
    typer.Option(
        "--track",
        help="Track; default: the standard one if jobs of it have ended, otherwise the one with "
        "the most ended jobs.",
    ),
]
AfterOption = Annotated[str | None, typer.Option("--after", help="Cursor of the previous page.")]
AllOption = Annotated[bool, typer.Option("--all", help="Every page.")]


def budget_of(
    max_cost_usd: float | None, max_tokens: int | None, max_requests: int | None
) -> dict[str, Any] | None:
    """The budget that options name; None when they name none."""
    limits = {
        "max_cost_usd": max_cost_usd,
        "max_tokens": max_tokens,
        "max_requests": max_requests,
    }
    return {name: value for name, value in limits.items() if value is not None} or None
