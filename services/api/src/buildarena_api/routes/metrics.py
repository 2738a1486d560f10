"""The route of metrics, in Prometheus' text format."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from buildarena_api.dependencies import ServicesDep

router = APIRouter(prefix="/v1", tags=["health"])


@router.get(
    "/metrics",
    response_class=Response,
    # Where a key of the database's is used, which is then asked for it.
    responses={200: {"content": {"text/plain": {}}}},
)
async def show_metrics(services: ServicesDep) -> Response:
    """Figures for Prometheus: jobs, queues, stage times, tokens, cost, errors, requests.

    Answers at once: what a part of the service does not answer is left out, and its `_up` is 0.
    """
    await services.parts.renew()
    return Response(generate_latest(services.metrics.registry), media_type=CONTENT_TYPE_LATEST)
