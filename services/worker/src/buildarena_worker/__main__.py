"""Entry point of a construct worker: ``python -m buildarena_worker``."""

import argparse
import os
import sys
from collections.abc import Iterable

from buildarena_backend.catalog.models import WatchedRegistry
from buildarena_backend.errors import StartupError
from buildarena_backend.process.worker_process import WorkerSpec, run_worker
from buildarena_backend.settings import load_settings
from buildarena_backend.states import CONSTRUCT_QUEUE, VERIFY_QUEUE
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_geometry import __version__ as geometry_version
from buildarena_worker.providers.checking import check_keys, check_model
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
            sys.exit(_report(check_model(registry, options.ask)))
        if options.check is not None:
            sys.exit(_report(check_keys(registry, os.environ, options.check)))
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


def _report(findings: Iterable[tuple[bool, str]]) -> int:
    """Print findings, and return 1 if one of them is bad."""
    code = 0
    for is_fine, text in findings:
        sys.stdout.write(f"{'ok  ' if is_fine else 'FAIL'}  {text}\n")
        code |= not is_fine
    return code


main()
