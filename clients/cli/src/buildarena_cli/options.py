"""Options that many commands share."""

from __future__ import annotations

from typing import Annotated

import typer

from buildarena_pipeline.settings import DEFAULT_PORT

DEFAULT_URL = f"http://127.0.0.1:{DEFAULT_PORT}"

UrlOption = Annotated[str, typer.Option("--url", envvar="BUILDARENA_URL", help="Where the API is.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
