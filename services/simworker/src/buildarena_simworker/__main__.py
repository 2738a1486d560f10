"""Starts a simulation worker: ``python -m buildarena_simworker --simulator pybullet``."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from buildarena_backend.errors import StartupError
from buildarena_backend.settings import Settings, load_settings
from buildarena_backend.trials.installed_simulators import announced, installed_simulators
from buildarena_geometry import __version__ as geometry_version

if TYPE_CHECKING:
    from buildarena_backend.process.context import Context


def main() -> None:
    """Serve one simulator's queue until shutdown.

    With ``--api`` it connects only to the API, as a runner; otherwise to database and broker.
    """
    parser = argparse.ArgumentParser(prog="buildarena_simworker", description=main.__doc__)
    parser.add_argument("--simulator", required=True, choices=list(installed_simulators()))
    parser.add_argument("--api", metavar="URL", help="reach only this API")
    parser.add_argument("--key-file", type=Path, help="the runner key; default: BUILDARENA_KEY")
    parser.add_argument("--ca-file", type=Path, help="certificates to trust besides the system's")
    parser.add_argument(
        "--concurrency",
        dest="at_once",
        type=int,
        choices=range(1, 65),
        metavar="N",
        help="trials to run concurrently",
    )
    parser.add_argument("--allow-http", action="store_true", help="send the key unencrypted")
    parser.add_argument("--check", action="store_true", help="only see whether it could work")
    parser.add_argument("--json", action="store_true", help="print the checks as JSON")
    options = parser.parse_args()
    try:
        settings = load_settings()
        if options.check:
            _check(options)
        elif options.api is not None:
            _serve_api(options, settings)
        else:
            _serve_database(options.simulator, settings)
    except StartupError as error:
        sys.exit(f"simulation worker: {error}")


def _serve_database(simulator: str, settings: Settings) -> None:
    # A runner has no such connections, and is not to load what makes them.
    from buildarena_backend.process.worker_process import WorkerSpec, run_worker
    from buildarena_backend.states import simulate_queue
    from buildarena_simworker.simulate import SimulateHandler

    described = installed_simulators()[simulator]
    first = described.make(settings)

    def handler(context: Context) -> SimulateHandler:
        # A process that others are forked from does no jobs itself.
        own = first if described.single else described.make(settings)
        return SimulateHandler(context, own)

    run_worker(
        WorkerSpec(
            kind="simulate",
            queues=[simulate_queue(simulator)],
            pool="solo" if described.single else "prefork",
            concurrency=1 if described.single else settings.simulations_per_worker,
            make_handler=handler,
            versions={"geometry": geometry_version, **first.versions, **announced(described)},
        ),
        settings,
    )


def _check(options: argparse.Namespace) -> None:
    from buildarena_simworker.remote.doctor import check_runner, format_checks

    if options.api is None:
        raise StartupError("--check needs --api URL")
    checks = list(
        check_runner(
            options.api,
            options.simulator,
            key_file=options.key_file,
            ca_file=options.ca_file,
            allow_http=options.allow_http,
        )
    )
    sys.stdout.write(format_checks(checks, as_json=options.json))
    sys.exit(0 if all(check["ok"] for check in checks) else 1)


def _serve_api(options: argparse.Namespace, settings: Settings) -> None:
    from buildarena_simworker.remote.process import RunnerOptions, read_key, serve

    name: str = options.simulator
    described = installed_simulators()[name]
    if described.single and (options.at_once or 1) > 1:
        raise StartupError(
            f"{name} runs one trial at a time, so --concurrency is 1: start a runner per machine"
        )
    first = described.make(settings)
    make = partial(described.make_isolated or described.make, settings)
    serve(
        RunnerOptions(
            url=options.api,
            key=read_key(options.key_file),
            simulator=name,
            version=str(first.versions["simulation"]),
            make=(lambda: first) if described.single else make,
            at_once=options.at_once or (1 if described.single else settings.simulations_per_worker),
            announced=announced(described),
            ca_file=options.ca_file,
            allow_http=options.allow_http,
            finishing_s=settings.finishing_s,
            log_level=settings.log_level,
        )
    )


main()
