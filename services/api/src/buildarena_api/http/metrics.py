"""Metrics for Prometheus: the service's from the database, the API's own from here.

Workers have no port: they report their figures to the database, where they are read.
"""

from __future__ import annotations

import platform
import shutil
from collections import Counter as Counts
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate, product
from typing import Any, Final

from prometheus_client import CollectorRegistry, Counter, Histogram, Info
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector
from sqlalchemy import Engine
from sqlalchemy.pool import QueuePool

from buildarena_api.http.parts import PartFailedError, Parts
from buildarena_backend import __version__
from buildarena_backend.process.context import Context
from buildarena_backend.states import (
    CONSTRUCT_QUEUE,
    AttemptResult,
    JobState,
    Outcome,
    Stage,
    simulate_queue,
)
from buildarena_backend.telemetry.metrics import STAGE_SECONDS, MetricValues
from buildarena_backend.trials.known_simulators import configured_simulators
from buildarena_backend.workers import WorkerCounts

PREFIX: Final = "buildarena_"
# Rates need a counter's zero, and alerts a gauge's: one that begins at its first event hides it.
PLACES: Final = tuple(
    (str(state), str(stage), str(outcome))
    for state in JobState
    for stage in Stage
    for outcome in (Outcome if state == JobState.DONE else ("",))
)
"""States, stages and outcomes that jobs may have together."""
STATUSES: Final = (
    *(200, 201, 202, 204, 304),
    *(400, 401, 403, 404, 405, 408, 409, 413, 422, 429),
    *(500, 503),
)
"""Usual status codes of the API."""


class ServiceMetrics(Collector):
    """The API's registry: its own requests, its process, and the service's figures.

    Args:
        pools: The process' pools of database connections, by what they are for.
        models: Models that jobs can name.
    """

    def __init__(
        self,
        context: Context,
        parts: Parts,
        *,
        pools: Mapping[str, Engine],
        models: Collection[str],
    ) -> None:
        self._folder = context.settings.artifact_folder
        self._parts, self._pools, self._models = parts, pools, models
        simulators = configured_simulators(context.settings)
        self._queues = (CONSTRUCT_QUEUE, *map(simulate_queue, simulators))
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        build = Info(PREFIX + "build", "The program that answers.", registry=self.registry)
        build.info({"version": __version__, "python": platform.python_version()})
        self.http_seconds = Histogram(
            PREFIX + "http_request_seconds",
            "Time to the end of an answer, by route, method and status.",
            ["route", "method", "status"],
            registry=self.registry,
        )
        self.responses = Counter(
            PREFIX + "http_responses",
            "Answers by status, whatever their route.",
            ["status"],
            registry=self.registry,
        )
        for status in STATUSES:
            self.responses.labels(str(status))
        self.registry.register(self)

    def describe(self) -> Iterable[Metric]:
        """Return nothing in advance: registration must not query anything."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """Yield the present figures; those that the database does not provide are left out."""
        parts = self._parts
        for name, part, meaning in (
            ("database_up", parts.database, "the database answers and has the schema expected"),
            ("artifact_store_up", parts.artifacts, "artifacts can be written and read"),
            ("broker_up", parts.broker, "the broker answers"),
        ):
            works = not isinstance(part.verdict, PartFailedError)
            yield _gauge(name, f"1 when {meaning}, else 0.", float(works))
        yield from self._of_the_process()
        counts, figures = parts.database.verdict, parts.figures.verdict
        if not isinstance(counts, PartFailedError):
            yield from _of_workers(counts, self._queues)
            if not isinstance(figures, PartFailedError):
                yield from _of_jobs(figures, self._queues)
                yield from _of_models(figures, self._models)
                yield _of_stages(figures)

    def _of_the_process(self) -> Iterable[Metric]:
        exists = next(at for at in (self._folder, *self._folder.parents) if at.exists())
        disk = shutil.disk_usage(exists)
        text = "Free space where artifacts lie, or the data folder where those are in a bucket."
        yield _gauge("data_free_bytes", text, disk.free)
        yield _gauge("data_size_bytes", "Size of that disk.", disk.total)
        used, limits = dict[str, int](), dict[str, int]()
        for name, engine in self._pools.items():
            if isinstance(engine.pool, QueuePool):
                # Pools may grow to twice their size (`buildarena_backend.database.database`).
                used[name], limits[name] = engine.pool.checkedout(), 2 * engine.pool.size()
        text = "Connections of this process in use."
        yield _gauges("database_connections_used", text, used, "pool")
        text = "Connections that a pool may open."
        yield _gauges("database_connections_limit", text, limits, "pool")


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(PREFIX + name, text, value=value)


def _gauges(name: str, text: str, values: Mapping[Any, float], *labels: str) -> Metric:
    return _fill(GaugeMetricFamily(PREFIX + name, text, labels=labels), values)


def _counters(name: str, text: str, values: Mapping[Any, float], *labels: str) -> Metric:
    return _fill(CounterMetricFamily(PREFIX + name, text, labels=labels), values)


def _fill(metric: GaugeMetricFamily | CounterMetricFamily, values: Mapping[Any, float]) -> Metric:
    """Return a metric with values by label, or by all labels where it has several."""
    for key, value in sorted(values.items()):
        metric.add_metric(list(key) if isinstance(key, tuple) else [str(key)], value)
    return metric


def _of_workers(counts: WorkerCounts, queues: Collection[str]) -> Iterable[Metric]:
    stages = dict.fromkeys(map(str, Stage), 0)
    text = "Worker processes alive, by kind."
    yield _gauges("workers", text, stages | dict(counts.alive), "kind")
    text = "Worker processes alive, by the queue they serve."
    serving = dict.fromkeys(queues, 0) | dict(counts.serving)
    yield _gauges("queue_workers", text, serving, "queue")
    text = "Worker processes that went silent within the last hour and did not sign off."
    lost = {kind: counts.lost.get(kind, 0) for kind in stages}
    yield _gauges("workers_lost", text, lost, "kind")
    text = "The most that a worker's clock differs from the database's."
    error_s = abs(counts.clocks[0][1]) if counts.clocks else 0.0
    yield _gauge("worker_clock_error_seconds", text, error_s)
    text = "The most memory that a worker ever had."
    yield _gauges("worker_peak_memory_bytes", text, counts.peak_memory_bytes, "kind")


def _of_jobs(figures: MetricValues, queues: Collection[str]) -> Iterable[Metric]:
    places, reasons = Counts(dict.fromkeys(PLACES, 0)), Counts[str]()
    for (state, stage, outcome, reason), number in figures.jobs.items():
        places[state, stage, outcome] += number
        if outcome == Outcome.ERRORED:
            reasons[reason] += number
    text = "Jobs by state, stage and outcome."
    yield _gauges("jobs", text, places, "state", "stage", "outcome")
    yield _gauges("errored_jobs", "Jobs that ended as errored, by class.", reasons, "reason")
    yield _gauges("sweeps", "Sweeps by state.", figures.sweeps, "state")
    none = dict.fromkeys(queues, 0)
    waiting = none | {queue.queue: queue.jobs for queue in figures.queues}
    yield _gauges("queue_jobs", "Jobs that wait.", waiting, "queue")
    oldest = none | {queue.queue: queue.oldest_s for queue in figures.queues}
    text = "How long the longest waiting job has waited."
    yield _gauges("queue_oldest_seconds", text, oldest, "queue")
    text = "Jobs that a worker is at, by the queue it took them from."
    yield _gauges("queue_running", text, none | figures.running, "queue")
    text = "Verifications that ended, by verdict."
    yield _counters("verifications", text, figures.verifications, "verdict")
    text = "Scored jobs that count once they are verified, or were refuted, by audit."
    yield _gauges("audited_jobs", text, figures.audits, "audit")


def _of_models(figures: MetricValues, names: Collection[str]) -> Iterable[Metric]:
    none = dict.fromkeys(names, 0.0)
    requests = none | {model: use["requests"] for model, use in figures.models.items()}
    yield _counters("model_requests", "Model requests answered.", requests, "model")
    tokens = {(name, direction): 0 for name in names for direction in ("input", "output")}
    for model, use in figures.models.items():
        tokens[model, "input"], tokens[model, "output"] = use["input_tokens"], use["output_tokens"]
    yield _counters("model_tokens", "Tokens, by direction.", tokens, "model", "direction")
    cost = none | {model: use["cost_usd"] for model, use in figures.models.items()}
    yield _counters("model_cost_usd", "US dollars spent on model requests.", cost, "model")


def _of_stages(figures: MetricValues) -> Metric:
    stages = HistogramMetricFamily(
        PREFIX + "stage_seconds",
        "How long attempts took, by stage and how they ended.",
        labels=["stage", "result"],
    )
    bounds = [*(str(float(bound)) for bound in STAGE_SECONDS), "+Inf"]
    none: tuple[Sequence[int], float] = [0] * len(bounds), 0.0
    for stage, result in product(Stage, AttemptResult):
        counts, total_s = figures.stages.get((stage, result), none)
        buckets = list(zip(bounds, accumulate(map(float, counts)), strict=True))
        stages.add_metric([stage, result], buckets, sum_value=total_s)
    return stages
