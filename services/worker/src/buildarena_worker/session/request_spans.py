"""Spans of model requests, by OpenTelemetry's GenAI conventions.

They contain the model, its use of tokens and the result, but no text of a conversation.

Source: OpenTelemetry, Semantic conventions for generative AI, client spans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from opentelemetry.trace import SpanKind

from buildarena_backend.telemetry.tracing import Attribute, mark_failed, span
from buildarena_worker.session.messages import Completion, Request

PROVIDERS: Final[Mapping[str, str]] = {
    "google": "gcp.gemini",
    "mistral": "mistral_ai",
    "xai": "x_ai",
}
"""The conventions' names of providers, where they differ from the registry's."""
USUAL_ENDS: Final = frozenset({"stop", "length", "tool_call"})
"""Finish reasons of usable replies; others are failures of the request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOfRequest:
    """Place of a request in its session.

    Attributes:
        phase: The session's phase.
        role: Name of the role that asks.
        sequence: Index in the journal, from 0.
    """

    phase: str
    role: str
    sequence: int


@contextmanager
def request_span(request: Request, place: PlaceOfRequest) -> Iterator[Callable[[Completion], None]]:
    """Open a span around a request with all its attempts.

    Yields:
        Function that records the reply.
    """
    config = request.model_config
    model, provider = str(config["model"]), str(config["provider"])
    attributes: dict[str, Attribute] = {
        "gen_ai.operation.name": "chat",
        "gen_ai.provider.name": PROVIDERS.get(provider, provider),
        "gen_ai.request.model": model,
        "buildarena.model": str(config["name"]),
        "buildarena.phase": place.phase,
        "buildarena.role": place.role,
        "buildarena.sequence": place.sequence,
    }
    with span(f"chat {model}", attributes, kind=SpanKind.CLIENT) as current:

        def record(completion: Completion) -> None:
            usage = completion.usage
            current.set_attribute("gen_ai.usage.input_tokens", usage.input_tokens)
            current.set_attribute("gen_ai.usage.output_tokens", usage.output_tokens)
            current.set_attribute("gen_ai.usage.cache_read.input_tokens", usage.cached_tokens)
            current.set_attribute("gen_ai.usage.reasoning.output_tokens", usage.reasoning_tokens)
            current.set_attribute("gen_ai.response.finish_reasons", [completion.finish])
            current.set_attribute("buildarena.cost_usd", float(usage.cost_usd))
            current.set_attribute("buildarena.tries", completion.attempts)
            if completion.provider_request_id is not None:
                current.set_attribute("gen_ai.response.id", completion.provider_request_id)
            if completion.finish not in USUAL_ENDS:
                mark_failed(current, completion.finish)

        yield record
