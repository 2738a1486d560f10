"""Entry point of a construct worker: ``python -m buildarena_worker``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from buildarena_backend.catalog.models import ModelRegistry, WatchedRegistry
from buildarena_backend.errors import StartupError
from buildarena_backend.process.worker_process import WorkerSpec, run_worker
from buildarena_backend.settings import load_settings
from buildarena_backend.states import CONSTRUCT_QUEUE, VERIFY_QUEUE
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_geometry import __version__ as geometry_version
from buildarena_worker.providers.checking import check_model, key_report
from buildarena_worker.providers.registry import require_known_protocols
from buildarena_worker.wiring import construct_handler, verification_runner


def main() -> None:
    """Serve the construct queue until the process is stopped."""
    parser = argparse.ArgumentParser(prog="buildarena_worker", description=main.__doc__)
    parser.add_argument(
        "--check",
        nargs="*",
        metavar="MODEL",
        help="only report which providers' keys are set; fail if a key of these models is not",
    )
    parser.add_argument("--ask", metavar="MODEL", help="only send one test request to this model")
    options = parser.parse_args()
    try:
        settings = load_settings()
        registry = WatchedRegistry(settings.models_file)
        require_known_protocols(registry)
        if options.ask is not None:
            sys.exit(_ask(registry, options.ask))
        if options.check is not None:
            sys.exit(_check(registry, options.check))
        run_worker(
            WorkerSpec(
                kind="construct",
                queues=[CONSTRUCT_QUEUE, VERIFY_QUEUE],
                pool="threads",
                concurrency=settings.sessions_per_worker,
                make_handler=lambda context: construct_handler(context, registry),
                make_side_work=lambda context: {VERIFY_QUEUE: verification_runner(context)},
                versions={"geometry": geometry_version, "feedback": FEEDBACK_VERSION},
            ),
            settings,
        )
    except StartupError as error:
        sys.exit(f"construct worker: {error}")


def _ask(registry: ModelRegistry, name: str) -> int:
    """Print whether sessions can use a model, and return 1 if they can't."""
    if name not in registry.models:
        raise StartupError(f"unknown model {name!r}; valid models: {', '.join(registry.models)}")
    code = 0
    for is_fine, text in check_model(registry, name):
        sys.stdout.write(f"{'ok  ' if is_fine else 'FAIL'}  {text}\n")
        code |= not is_fine
    return code


def _check(registry: ModelRegistry, models: Sequence[str]) -> int:
    """Print which providers' keys are set, and return 1 if one of these models can't be reached."""
    report = key_report(registry, os.environ)
    unknown = [name for name in models if name not in registry.models]
    lines = [*report.lines(), *(f"{name}: unknown model" for name in unknown)]
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    return int(bool(report.unused or unknown or set(models) & set(report.without)))


main()
