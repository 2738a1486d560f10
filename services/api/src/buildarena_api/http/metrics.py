"""Metrics for Prometheus: the service's from the database, the API's own from here."""

from __future__ import annotations

import platform
from collections.abc import Collection, Iterable
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Histogram, Info
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from buildarena_api.http.probes import PartFailedError, Probes
from buildarena_api.http.server_metrics import server_metrics
from buildarena_backend import __version__
from buildarena_backend.states import (
    CONSTRUCT_QUEUE,
    AttemptResult,
    JobState,
    Outcome,
    Stage,
    simulate_queue,
)
from buildarena_backend.telemetry.metrics import (
    STAGE_SECONDS,
    MetricValues,
    ModelUse,
    QueueDepth,
    StageTimes,
)

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
"""What the API usually answers."""


class ServiceMetrics(Collector):
    """The API's registry: its own requests, its process, and the service's figures.

    Args:
        probes: What the service stands on.
        simulators: Those that have jobs whether or not there is one now.
        models: Those that jobs can name.
    """

    def __init__(
        self, probes: Probes, *, simulators: Collection[str], models: Collection[str]
    ) -> None:
        self._probes = probes
        self._queues = (CONSTRUCT_QUEUE, *map(simulate_queue, simulators))
        self._models = models
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        build = Info("buildarena_build", "The program that answers.", registry=self.registry)
        build.info({"version": __version__, "python": platform.python_version()})
        self.http_seconds = Histogram(
            "buildarena_http_request_seconds",
            "Time to the end of an answer, by route, method and status.",
            ["route", "method", "status"],
            registry=self.registry,
        )
        self.responses = Counter(
            "buildarena_http_responses",
            "Answers by status, whatever their route.",
            ["status"],
            registry=self.registry,
        )
        for status in STATUSES:
            self.responses.labels(str(status))
        self.registry.register(self)

    def describe(self) -> Iterable[Metric]:
        """Nothing in advance: registering must not read the database."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """The service's figures as metrics; none while the database does not answer."""
        try:
            figures, counts = self._probes.values.latest(), self._probes.database.latest()
        except PartFailedError:
            return
        yield from _job_metrics(figures)
        yield from _queue_metrics(figures, self._queues)
        yield from _model_metrics(figures, self._models)
        yield _stage_metric(figures)
        yield from _audit_metrics(figures)
        yield from server_metrics(figures.server)
        workers = GaugeMetricFamily(
            "buildarena_workers", "Worker processes alive, by kind.", labels=["kind"]
        )
        for kind, alive in sorted({**{str(stage): 0 for stage in Stage}, **counts.alive}.items()):
            workers.add_metric([kind], alive)
        yield workers


def _job_metrics(figures: MetricValues) -> Iterable[Metric]:
    jobs = GaugeMetricFamily(
        "buildarena_jobs",
        "Jobs by state, stage and outcome.",
        labels=["state", "stage", "outcome"],
    )
    errors = GaugeMetricFamily(
        "buildarena_errored_jobs", "Jobs that ended as errored, by class.", labels=["reason"]
    )
    counts = dict.fromkeys(PLACES, 0)
    for count in figures.jobs:
        key = (count.state, count.stage, count.outcome)
        counts[key] = counts.get(key, 0) + count.jobs
    for key, number in counts.items():
        jobs.add_metric(list(key), number)
    reasons: dict[str, int] = {}
    for count in figures.jobs:
        if count.outcome == Outcome.ERRORED:
            reasons[count.reason] = reasons.get(count.reason, 0) + count.jobs
    for reason, number in reasons.items():
        errors.add_metric([reason], number)
    sweeps = GaugeMetricFamily("buildarena_sweeps", "Sweeps by state.", labels=["state"])
    for state, number in figures.sweeps.items():
        sweeps.add_metric([state], number)
    return jobs, errors, sweeps


def _queue_metrics(figures: MetricValues, known: Collection[str]) -> Iterable[Metric]:
    depth = GaugeMetricFamily("buildarena_queue_jobs", "Jobs that wait.", labels=["queue"])
    oldest = GaugeMetricFamily(
        "buildarena_queue_oldest_seconds",
        "How long the longest waiting job has waited.",
        labels=["queue"],
    )
    waiting = {name: QueueDepth(queue=name, jobs=0, oldest_s=0.0) for name in known}
    for name, queue in sorted((waiting | {each.queue: each for each in figures.queues}).items()):
        depth.add_metric([name], queue.jobs)
        oldest.add_metric([name], queue.oldest_s)
    running = GaugeMetricFamily(
        "buildarena_queue_running",
        "Jobs that a worker is at, by the queue it took them from.",
        labels=["queue"],
    )
    for name, number in sorted((dict.fromkeys(known, 0) | figures.running).items()):
        running.add_metric([name], number)
    return depth, oldest, running


def _model_metrics(figures: MetricValues, known: Collection[str]) -> Iterable[Metric]:
    requests = CounterMetricFamily(
        "buildarena_model_requests", "Model requests answered.", labels=["model"]
    )
    tokens = CounterMetricFamily(
        "buildarena_model_tokens", "Tokens, by direction.", labels=["model", "direction"]
    )
    cost = CounterMetricFamily(
        "buildarena_model_cost_usd", "US dollars spent on model requests.", labels=["model"]
    )
    none = {name: ModelUse.none(name) for name in known}
    for use in (none | {each.model: each for each in figures.models}).values():
        requests.add_metric([use.model], use.requests)
        tokens.add_metric([use.model, "input"], use.input_tokens)
        tokens.add_metric([use.model, "output"], use.output_tokens)
        cost.add_metric([use.model], use.cost_usd)
    return requests, tokens, cost


def _audit_metrics(figures: MetricValues) -> Iterable[Metric]:
    verifications = CounterMetricFamily(
        "buildarena_verifications", "Verifications that ended, by verdict.", labels=["verdict"]
    )
    for verdict, number in sorted(figures.verifications.items()):
        verifications.add_metric([verdict], number)
    audits = GaugeMetricFamily(
        "buildarena_audited_jobs",
        "Scored jobs that count once they are verified, or were refuted, by audit.",
        labels=["audit"],
    )
    for audit, number in sorted(figures.audits.items()):
        audits.add_metric([audit], number)
    return verifications, audits


def _stage_metric(figures: MetricValues) -> Metric:
    stages = HistogramMetricFamily(
        "buildarena_stage_seconds",
        "How long attempts took, by stage and how they ended.",
        labels=["stage", "result"],
    )
    none = {
        (stage, result): StageTimes.none(stage, result)
        for stage in Stage
        for result in AttemptResult
    }
    known = none | {(times.stage, times.result): times for times in figures.stages}
    bounds = [*(str(float(bound)) for bound in STAGE_SECONDS), "+Inf"]
    for times in known.values():
        buckets = []
        total = 0
        for bound, count in zip(bounds, times.counts, strict=True):
            total += count
            buckets.append((bound, float(total)))
        stages.add_metric([times.stage, times.result], buckets, sum_value=times.total_s)
    return stages
