"""One trace from a submission to its score: the real API and the real stages."""

import pytest
from opentelemetry.sdk.trace import ReadableSpan
from opentelemetry.semconv._incubating.attributes import gen_ai_attributes as gen_ai
from opentelemetry.semconv.attributes import error_attributes, http_attributes
from opentelemetry.trace import SpanKind, StatusCode
from support.jobs import claim, expire_leases
from support.providers.stand_in import ProviderStandIn
from support.servers.construct_threads import crew
from support.servers.live_api import api_client, live_api
from support.servers.runner_rig import slot
from support.stages import work
from support.statements import Spans, recorded

from buildarena_backend.telemetry.tracing import current_traceparent, span

JOB = {"task": "lift-1", "model": "builtin/expert", "simulator": "mujoco"}
TRACE, CALLER = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"
STAGES = ("construct", "simulate")


def sampled(flag: str = "01") -> dict[str, str]:
    return {"traceparent": f"00-{TRACE}-{CALLER}-{flag}"}


def submitted(context, path: str = "/v1/jobs", headers=None, **spec: object) -> dict:
    with api_client(context) as api:
        body = {**JOB, **spec} if path == "/v1/jobs" else spec
        answer = api.post(path, json=body, headers=headers)
    assert answer.status_code == 201, answer.text
    return answer.json()


def trace_of(one: ReadableSpan) -> str:
    return f"{one.context.trace_id:032x}"


def request_of(spans: Spans, route: str) -> ReadableSpan:
    """The newest span of a request that was posted."""
    return spans.named(f"POST {route}")[-1]


def assert_children(of: ReadableSpan, children: list[ReadableSpan]) -> None:
    assert children
    for child in children:
        assert child.parent is not None
        assert child.parent.span_id == of.context.span_id
        assert child.context.trace_id == of.context.trace_id


def test_what_is_submitted_is_one_trace_and_goes_on_a_callers(context) -> None:
    sweep = {"tasks": ["support-1", "lift-1"], "models": ["builtin/idle"], "seeds": [0]}
    with recorded() as spans:
        job = submitted(context)
        lease = claim(context)
        expire_leases(context)
        context.store.leases.recover()  # a job that loses its worker stays in its trace
        submitted(context, "/v1/sweeps", headers=sampled(), **sweep)
        work(context)
    root, other = request_of(spans, "/v1/jobs"), request_of(spans, "/v1/sweeps")
    assert root.parent is None
    assert root.kind == SpanKind.SERVER
    assert root.attributes[http_attributes.HTTP_RESPONSE_STATUS_CODE] == 201
    stages = [one for one in spans.named(*STAGES) if one.attributes["buildarena.job"] == job["id"]]
    assert [one.name for one in stages] == list(STAGES)
    assert stages[0].attributes["buildarena.token"] == lease.token + 1
    assert_children(root, stages)
    assert (trace_of(other), f"{other.parent.span_id:016x}") == (TRACE, CALLER)
    assert_children(other, [one for one in spans.named(*STAGES) if one not in stages])
    assert {trace_of(one) for one in spans.all()} == {trace_of(root), TRACE}


def test_model_requests_follow_the_genai_conventions(context) -> None:
    with recorded() as spans:
        job = submitted(context)
        work(context)
    (stage,) = spans.named("construct")
    chats = spans.named("chat expert")
    assert_children(stage, chats)
    entries = context.store.journal.read(job["id"])
    assert len(chats) == len(entries)
    for one, entry in zip(chats, entries, strict=True):
        assert one.kind == SpanKind.CLIENT
        assert one.attributes[gen_ai.GEN_AI_OPERATION_NAME] == "chat"
        assert one.attributes[gen_ai.GEN_AI_PROVIDER_NAME] == "builtin"
        assert one.attributes[gen_ai.GEN_AI_REQUEST_MODEL] == "expert"
        assert one.attributes[gen_ai.GEN_AI_USAGE_INPUT_TOKENS] == entry.usage.input_tokens
        assert one.attributes[gen_ai.GEN_AI_USAGE_OUTPUT_TOKENS] == entry.usage.output_tokens
        assert one.attributes[gen_ai.GEN_AI_RESPONSE_FINISH_REASONS] == (entry.reply["finish"],)
        assert one.status.status_code == StatusCode.UNSET
    said = " ".join(one.to_json() for one in spans.all())
    task = context.tasks.newest()[JOB["task"]]
    assert task.statement[:40] not in said
    for entry in entries:
        if len(entry.reply["text"]) > 20:
            assert entry.reply["text"][:20] not in said


def test_a_caller_that_is_not_sampled_is_followed(context) -> None:
    with recorded() as spans:
        job = submitted(context, headers=sampled("00"))
        work(context)
    assert spans.all() == []
    # Another process decides the same.
    kept = context.store.jobs.get(job["id"]).traceparent
    assert kept.startswith(f"00-{TRACE}-")
    assert kept.endswith("-00")


def test_a_request_that_fails_says_how(context, tmp_path) -> None:
    faults = {0: "429", 1: None, 2: "garbage", 3: "401"}
    bad = ProviderStandIn(fault=lambda number: faults.get(number, "401"))
    with bad, crew(context, tmp_path, bad=bad) as workers, recorded() as spans:
        with span("submission", {}):
            job_id, kept = workers.submit("bad"), current_traceparent()
        workers.ended(job_id)
    assert context.store.jobs.get(job_id).traceparent == kept
    first, second, third = spans.named("chat expert")
    assert [event.name for event in first.events] == ["retry"]
    assert first.events[0].attributes[error_attributes.ERROR_TYPE] == "outage"
    assert first.attributes[gen_ai.GEN_AI_USAGE_INPUT_TOKENS] > 0
    assert error_attributes.ERROR_TYPE not in first.attributes
    assert second.attributes[error_attributes.ERROR_TYPE] == "garbage"
    assert third.attributes[error_attributes.ERROR_TYPE] == "bad_credentials"
    for one in (second, third):
        assert one.status.status_code == StatusCode.ERROR
    assert "stand-in says no" not in " ".join(one.to_json() for one in spans.all())


def test_what_machines_poll_is_not_traced(context) -> None:
    with recorded() as spans, api_client(context) as api:
        for path in ("/v1/health", "/v1/metrics"):
            api.get(path, headers=sampled())
        api.get("/v1/models", headers={"traceparent": "nonsense"})
    (one,) = spans.all()
    assert (one.name, one.parent) == ("GET /v1/models", None)


@pytest.mark.ci
def test_a_runner_s_trial_is_scored_in_its_job_s_trace(context) -> None:
    with recorded() as spans:
        submitted(context)
        work(context, queues=("construct",))
        with live_api(context) as url, slot(url, None) as runner:
            assert runner.do_next(10.0)
    (one,) = spans.named("score")
    assert_children(request_of(spans, "/v1/jobs"), [one])
