"""Starts a simulation worker: ``python -m buildarena_simworker --engine pybullet``."""

from __future__ import annotations

import argparse
import sys

from buildarena_geometry import __version__ as geometry_version
from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.runtime.settings import Settings
from buildarena_pipeline.runtime.worker_process import WorkerSpec, run_worker
from buildarena_simulation import ENGINES, SIMULATION_VERSION
from buildarena_simworker.simulate import simulate_handler
from buildarena_store.states import simulate_queue


def main() -> None:
    """Serves one simulator's queue until it is asked to stop."""
    parser = argparse.ArgumentParser(prog="buildarena_simworker", description=main.__doc__)
    parser.add_argument("--engine", required=True, choices=sorted(ENGINES))
    engine = parser.parse_args().engine
    settings = Settings()
    try:
        run_worker(
            WorkerSpec(
                kind="simulate",
                queues=[simulate_queue(engine)],
                pool="prefork",
                concurrency=settings.simulations_per_worker,
                make_handler=simulate_handler,
                versions={
                    "geometry": geometry_version,
                    "simulation": SIMULATION_VERSION,
                    "engine": engine,
                },
            ),
            settings,
        )
    except StartupError as error:
        sys.exit(f"simulation worker: {error}")


main()
