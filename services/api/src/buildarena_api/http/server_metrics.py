"""Metrics of the Postgres server."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from buildarena_backend.telemetry.server_figures import ServerFigures

PREFIX: Final = "buildarena_postgres_"


def server_metrics(figures: ServerFigures) -> Iterable[Metric]:
    """The server's figures as metrics."""
    gauges: tuple[tuple[str, str, float], ...] = (
        ("size_bytes", "Size of the database on disk.", figures.size_bytes),
        (
            "server_connections",
            "Connections to all databases of the server.",
            figures.server_connections,
        ),
        (
            "server_connections_limit",
            "Connections that the server takes.",
            figures.server_connections_limit,
        ),
        (
            "oldest_transaction_seconds",
            "How long the oldest transaction has been open, of those that the API's login sees.",
            figures.oldest_transaction_s,
        ),
        (
            "transaction_age",
            "Transactions since the oldest row that is not frozen.",
            figures.transaction_age,
        ),
    )
    for name, what, value in gauges:
        yield GaugeMetricFamily(PREFIX + name, what, value=value)
    for name, what, label, values in (
        ("connections", "Connections to the database, by state.", "state", figures.connections),
        ("rows", "Live rows, as the server estimates them.", "table", figures.rows),
        ("dead_rows", "Rows that are to be removed, likewise.", "table", figures.dead_rows),
    ):
        metric = GaugeMetricFamily(PREFIX + name, what, labels=[label])
        for key, number in sorted(values.items()):
            metric.add_metric([key], number)
        yield metric
    transactions = CounterMetricFamily(
        PREFIX + "transactions", "Transactions that ended, by how.", labels=["result"]
    )
    transactions.add_metric(["committed"], figures.committed)
    transactions.add_metric(["rolled_back"], figures.rolled_back)
    yield transactions
    yield CounterMetricFamily(
        PREFIX + "deadlocks", "Transactions undone by deadlocks.", value=figures.deadlocks
    )
