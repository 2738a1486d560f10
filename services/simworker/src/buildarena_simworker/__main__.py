"""Starts a simulation worker: ``python -m buildarena_simworker --simulator pybullet``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from buildarena_geometry import __version__ as geometry_version
from buildarena_pipeline.catalog.simulators import BESIEGE, SIMULATORS
from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.runtime.settings import Settings, load_settings
from buildarena_simworker.simulators.engines import EngineSimulator
from buildarena_simworker.simulators.simulator import Simulator


@dataclass(frozen=True, slots=True, kw_only=True)
class _Served:
    """How one simulator is served; a game has one window and so does one job at a time."""

    make: Callable[[], Simulator]
    versions: Mapping[str, Any]
    pool: str
    concurrency: int


def main() -> None:
    """Serves one simulator's queue until it is asked to stop.

    With ``--api`` it reaches nothing but the API, as a runner; otherwise database and broker.
    """
    parser = argparse.ArgumentParser(prog="buildarena_simworker", description=main.__doc__)
    parser.add_argument("--simulator", required=True, choices=sorted(SIMULATORS))
    parser.add_argument("--api", metavar="URL", help="reach only this API")
    parser.add_argument("--key-file", type=Path, help="the runner key; default: BUILDARENA_KEY")
    parser.add_argument("--ca-file", type=Path, help="certificates to trust besides the system's")
    parser.add_argument("--at-once", type=int, help="trials at once")
    parser.add_argument("--allow-http", action="store_true", help="send the key unencrypted")
    parser.add_argument("--check", action="store_true", help="only see whether it could work")
    parser.add_argument("--json", action="store_true", help="print the checks as JSON")
    given = parser.parse_args()
    try:
        settings = load_settings()
        if given.check:
            _check(given)
        elif given.api is not None:
            _serve_api(given, settings)
        else:
            _serve_database(given.simulator, settings)
    except StartupError as error:
        sys.exit(f"simulation worker: {error}")


def _serve_database(simulator: str, settings: Settings) -> None:
    # A runner has no such connections, and is not to load what makes them.
    from buildarena_pipeline.runtime.worker_process import WorkerSpec, run_worker
    from buildarena_simworker.simulate import simulate_handler
    from buildarena_store.states import simulate_queue

    served = _besiege(settings) if simulator == BESIEGE else _engine(simulator, settings)
    run_worker(
        WorkerSpec(
            kind="simulate",
            queues=[simulate_queue(simulator)],
            pool=served.pool,
            concurrency=served.concurrency,
            make_handler=lambda context: simulate_handler(context, served.make()),
            versions={"geometry": geometry_version, **served.versions},
        ),
        settings,
    )


def _check(given: argparse.Namespace) -> None:
    from buildarena_simworker.remote.doctor import examined, printed

    if given.api is None:
        raise StartupError("--check needs --api URL")
    checks = examined(
        given.api,
        given.simulator,
        key_file=given.key_file,
        ca_file=given.ca_file,
        allow_http=given.allow_http,
    )
    sys.stdout.write(printed(checks, as_json=given.json))
    sys.exit(0 if all(check["ok"] for check in checks) else 1)


def _serve_api(given: argparse.Namespace, settings: Settings) -> None:
    from buildarena_simworker.remote.engine_process import EngineProcess
    from buildarena_simworker.remote.process import RunnerOptions, read_key, serve

    name: str = given.simulator
    served = _besiege(settings) if name == BESIEGE else _engine(name, settings)

    def warm_engine() -> Simulator:
        engine = EngineProcess(name)
        engine.start()
        return engine

    at_once = given.at_once or served.concurrency
    if at_once > 1 and name == BESIEGE:
        raise StartupError("a game has one window, so --at-once is 1: start a runner per machine")
    serve(
        RunnerOptions(
            url=given.api,
            key=read_key(given.key_file),
            simulator=name,
            version=str(served.versions["simulation"]),
            make=served.make if name == BESIEGE else warm_engine,
            at_once=at_once,
            ca_file=given.ca_file,
            allow_http=given.allow_http,
            log_level=settings.log_level,
        )
    )


def _engine(name: str, settings: Settings) -> _Served:
    return _Served(
        make=lambda: EngineSimulator(name),
        versions=EngineSimulator(name).versions,
        pool="prefork",
        concurrency=settings.simulations_per_worker,
    )


def _besiege(settings: Settings) -> _Served:
    from buildarena_simworker.simulators.besiege.simulator import besiege_simulator

    game = besiege_simulator(settings)
    return _Served(make=lambda: game, versions=game.versions, pool="solo", concurrency=1)


main()
