"""The route of metrics, in Prometheus' text format."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from buildarena_api.http.metrics import ServiceMetrics
from buildarena_api.http.problems import problem_responses

router = APIRouter(prefix="/v1", tags=["health"])


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}}, **problem_responses(503)},
)
def show_metrics(request: Request) -> Response:
    """Figures for Prometheus: jobs, queues, stage times, tokens, cost, errors, requests."""
    metrics: ServiceMetrics = request.app.state.metrics
    return Response(generate_latest(metrics.registry), media_type=CONTENT_TYPE_LATEST)
