"""Traces arrive at a collector, whole or not at all."""

import os
import subprocess
import sys
from collections import Counter

import pytest
from support.servers.collector import collector
from support.statements import recorded

from buildarena_backend.errors import TransientError
from buildarena_backend.telemetry.tracing import current_traceparent, span

PROGRAM = """
import sys
from buildarena_backend.telemetry.tracing import Tracing, current_traceparent, span

tracing = Tracing("test", sys.argv[1])
for number in range(40):
    with span("submission", {}):
        kept = current_traceparent()
    for stage in ("construct", "simulate"):
        with span(stage, {"buildarena.job": f"job_{number}"}, parent=kept):
            with span("inside", {}):
                pass
try:
    with span("alone", {}):
        raise ValueError("what a model wrote")
except ValueError:
    pass
tracing.close()
"""


def sent(**environment: str):
    """What the program sends, and where to."""
    with collector() as kept:
        # A process of its own: a tracer provider is set once in a process.
        words = [sys.executable, "-c", PROGRAM, kept.url]
        subprocess.run(words, check=True, timeout=60, env={**os.environ, **environment})
    return kept


def test_all_that_is_done_for_a_submission_is_one_trace_at_the_collector() -> None:
    kept = sent()
    assert kept.paths == {"/v1/traces"}
    spans = [one for service, one in kept.spans() if service == "buildarena-test"]
    assert len(spans) == 40 * 5 + 1
    assert len({one.trace_id for one in spans}) == 41
    roots = [one for one in spans if not one.parent_span_id]
    assert {one.name for one in roots} == {"submission", "alone"}
    assert "what a model wrote" not in str(kept.requests)
    failed = [one for one in spans if one.status.message == "ValueError"]
    assert [one.name for one in failed] == ["alone"]


def test_a_fault_of_ours_is_named_by_its_reason() -> None:
    with recorded() as spans, pytest.raises(TransientError), span("construct", {}):
        raise TransientError("key sk-1 was refused", reason="provider_outage")
    (one,) = spans.all()
    assert one.attributes["error.type"] == "provider_outage"
    assert "sk-1" not in one.to_json()


def test_a_sampled_trace_is_whole_and_where_none_is_sampled_none_is_kept() -> None:
    kept = sent(OTEL_TRACES_SAMPLER="traceidratio", OTEL_TRACES_SAMPLER_ARG="0.5")
    sizes = Counter(one.trace_id for _, one in kept.spans() if one.name != "alone")
    assert 5 < len(sizes) < 35
    assert set(sizes.values()) == {5}
    assert sent(OTEL_TRACES_SAMPLER="always_off").spans() == []


def test_a_parent_that_can_not_be_read_is_none() -> None:
    for parent in ("", "00-zz", "00-" + "0" * 32 + "-" + "0" * 16 + "-01"):
        with recorded() as spans, span("outside", {}), span("inside", {}, parent=parent):
            pass
        assert spans.named("inside")[0].parent is None, parent
    with span("construct", {}):
        assert current_traceparent() is None, "what is not traced has no context"
