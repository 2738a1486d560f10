"""Metrics for Prometheus: the service's from the database, the API's own from here."""

from __future__ import annotations

from collections.abc import Iterable

from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from buildarena_api.http.probes import PartFailedError, Probes
from buildarena_store import STAGE_SECONDS, MetricValues, Outcome, Stage
from buildarena_store.metrics import StageTimes
from buildarena_store.states import AttemptResult


class ServiceMetrics(Collector):
    """The API's registry: its own requests, its process, and the service's figures.

    Args:
        probes: What the service stands on.
    """

    def __init__(self, probes: Probes) -> None:
        self._probes = probes
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self.http_seconds = Histogram(
            "buildarena_http_request_seconds",
            "Time to the end of an answer, by route, method and status.",
            ["route", "method", "status"],
            registry=self.registry,
        )
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
        yield from _queue_metrics(figures)
        yield from _model_metrics(figures)
        yield _stage_metric(figures)
        yield from _audit_metrics(figures)
        workers = GaugeMetricFamily(
            "buildarena_workers", "Worker processes alive, by kind.", labels=["kind"]
        )
        for kind, alive in sorted(counts.alive.items()):
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
    counts: dict[tuple[str, str, str], int] = {}
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


def _queue_metrics(figures: MetricValues) -> Iterable[Metric]:
    depth = GaugeMetricFamily("buildarena_queue_jobs", "Jobs that wait.", labels=["queue"])
    oldest = GaugeMetricFamily(
        "buildarena_queue_oldest_seconds",
        "How long the longest waiting job has waited.",
        labels=["queue"],
    )
    for queue in figures.queues:
        depth.add_metric([queue.queue], queue.jobs)
        oldest.add_metric([queue.queue], queue.oldest_s)
    running = GaugeMetricFamily(
        "buildarena_queue_running",
        "Jobs that a worker is at, by the queue it took them from.",
        labels=["queue"],
    )
    for name, number in sorted(figures.running.items()):
        running.add_metric([name], number)
    return depth, oldest, running


def _model_metrics(figures: MetricValues) -> Iterable[Metric]:
    requests = CounterMetricFamily(
        "buildarena_model_requests", "Model requests answered.", labels=["model"]
    )
    tokens = CounterMetricFamily(
        "buildarena_model_tokens", "Tokens, by direction.", labels=["model", "direction"]
    )
    cost = CounterMetricFamily(
        "buildarena_model_cost_usd", "US dollars spent on model requests.", labels=["model"]
    )
    for use in figures.models:
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
    # Rates need a counter's zero: one that begins at its first event hides it.
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
