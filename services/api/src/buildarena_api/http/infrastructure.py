"""Metrics of what the service stands on: workers, stores, disk and database connections.

Workers have no port: what they know of themselves they report to the database, and is read there.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from typing import Final

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import Engine
from sqlalchemy.pool import QueuePool

from buildarena_api.http.probes import Probes
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE, simulate_queue
from buildarena_backend.trials.known_simulators import configured_simulators
from buildarena_backend.workers import WorkerCounts

PREFIX: Final = "buildarena_"


class InfrastructureMetrics(Collector):
    """Figures of workers, artifact store, broker, disk and connections.

    Args:
        context: The process' connections.
        probes: What the service stands on.
        pools: The process' pools of database connections, by what they are for.
    """

    def __init__(
        self,
        context: Context,
        probes: Probes,
        pools: Mapping[str, Engine],
    ) -> None:
        self._context = context
        self._probes = probes
        self._pools = pools

    def describe(self) -> Iterable[Metric]:
        """Nothing in advance: registering must not try the stores."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """The figures of this moment."""
        probes = self._probes
        for name, probe, what in (
            ("database_up", probes.database, "the database answers and has the schema expected"),
            ("artifact_store_up", probes.artifacts, "artifacts can be written and read"),
            ("broker_up", probes.broker, "the broker answers"),
        ):
            yield self._one(name, f"1 when {what}, else 0.", float(probe.works))
        if probes.database.works:
            yield from self._workers(probes.database.latest())
        folder = self._context.settings.artifact_folder
        disk = shutil.disk_usage(next(at for at in (folder, *folder.parents) if at.exists()))
        yield self._one(
            "data_free_bytes",
            "Free space where artifacts lie, or the data folder where those are in a bucket.",
            disk.free,
        )
        yield self._one("data_size_bytes", "Size of that disk.", disk.total)
        yield from self._connections()

    def _workers(self, counts: WorkerCounts) -> Iterable[Metric]:
        queues = [
            CONSTRUCT_QUEUE,
            *map(simulate_queue, configured_simulators(self._context.settings)),
        ]
        yield self._each(
            "queue_workers",
            "Worker processes alive, by the queue they serve.",
            "queue",
            {queue: counts.serving.get(queue, 0) for queue in {*queues, *counts.serving}},
        )
        yield self._each(
            "workers_lost",
            "Worker processes that went silent within the last hour and did not sign off.",
            "kind",
            {kind: counts.lost.get(kind, 0) for kind in ("construct", "simulate")},
        )
        yield self._one(
            "worker_clock_error_seconds",
            "The most that a worker's clock differs from the database's.",
            abs(counts.clocks[0][1]) if counts.clocks else 0.0,
        )
        yield self._each(
            "worker_peak_memory_bytes",
            "The most memory that a worker ever had.",
            "kind",
            counts.peak_memory_bytes,
        )

    def _connections(self) -> Iterable[Metric]:
        used, most = {}, {}
        for name, engine in self._pools.items():
            pool = engine.pool
            if isinstance(pool, QueuePool):
                used[name] = pool.checkedout()
                # Pools may grow to twice their size (`buildarena_backend.Database`).
                most[name] = 2 * pool.size()
        yield self._each(
            "database_connections_used", "Connections of this process in use.", "pool", used
        )
        yield self._each(
            "database_connections_limit", "Connections that a pool may open.", "pool", most
        )

    @staticmethod
    def _one(name: str, what: str, value: float) -> Metric:
        return GaugeMetricFamily(PREFIX + name, what, value=value)

    @staticmethod
    def _each(name: str, what: str, label: str, values: Mapping[str, float]) -> Metric:
        metric = GaugeMetricFamily(PREFIX + name, what, labels=[label])
        for key, value in sorted(values.items()):
            metric.add_metric([key], value)
        return metric
