"""Starts and ends the process of the API."""

from __future__ import annotations

import gc
import sys

from buildarena_api.access import check_binding
from buildarena_api.app import POOL_SIZE, create_app
from buildarena_api.dependencies import POOL_TIMEOUT_S
from buildarena_api.http.door import serve, server_config
from buildarena_backend.catalog.models import WatchedRegistry
from buildarena_backend.errors import StartupError
from buildarena_backend.process.context import open_checked_context
from buildarena_backend.settings import load_settings
from buildarena_backend.telemetry.logs import set_up_logs
from buildarena_backend.telemetry.tracing import Tracing
from buildarena_benchmark.environment.trials.processes import end_with_parent

SWITCH_S = 0.0001
"""Switch interval: a cheap request needs the interpreter some twenty times, and waits up to this
long each time while an expensive one is answered."""
COLLECTING = (5_000, 10, 30)
"""Thresholds of the garbage collector: seldom over the objects of a request for 10,000 jobs, as
that takes 0.1 s in which no request is answered."""


def main() -> None:
    """Serve the API until it is asked to stop."""
    sys.setswitchinterval(SWITCH_S)
    end_with_parent()
    try:
        settings = load_settings()
        set_up_logs(settings.log_level)
        check_binding(settings)
        tracing = Tracing("api", settings.otlp_endpoint)
        registry = WatchedRegistry(settings.models_file)
        context = open_checked_context(
            settings, pool_size=POOL_SIZE, pool_timeout_s=POOL_TIMEOUT_S, name="buildarena-api"
        )
    except (StartupError, ValueError) as error:
        sys.exit(f"api: {error}")
    app = create_app(context, registry)
    _settle()
    try:
        serve(server_config(app, settings))
    finally:
        context.close()
        tracing.close()


def _settle() -> None:
    """Exclude the process' permanent objects from garbage collection.

    Scanning it all takes 0.2 s, in which no request is answered, and happens whenever a request
    makes many objects.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*COLLECTING)
    gc.enable()
