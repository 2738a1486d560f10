"""Starts a simulation worker: ``python -m buildarena_simworker --simulator pybullet``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from buildarena_geometry import __version__ as geometry_version
from buildarena_pipeline.catalog.simulators import BESIEGE, SIMULATORS
from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.runtime.settings import Settings, load_settings
from buildarena_pipeline.runtime.worker_process import WorkerSpec, run_worker
from buildarena_simworker.simulate import simulate_handler
from buildarena_simworker.simulators.engines import EngineSimulator
from buildarena_simworker.simulators.simulator import Simulator
from buildarena_store.states import simulate_queue


@dataclass(frozen=True, slots=True, kw_only=True)
class _Served:
    """How one simulator is served; a game has one window and so does one job at a time."""

    make: Callable[[], Simulator]
    versions: Mapping[str, Any]
    pool: str
    concurrency: int


def main() -> None:
    """Serves one simulator's queue until it is asked to stop."""
    parser = argparse.ArgumentParser(prog="buildarena_simworker", description=main.__doc__)
    parser.add_argument("--simulator", required=True, choices=sorted(SIMULATORS))
    simulator = parser.parse_args().simulator
    try:
        settings = load_settings()
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
    except StartupError as error:
        sys.exit(f"simulation worker: {error}")


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
