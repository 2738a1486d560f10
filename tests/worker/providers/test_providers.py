from __future__ import annotations

import random
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from support.providers.stand_in import ProviderStandIn

from buildarena_geometry import ToolDefinition
from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_pipeline.errors import PermanentError, TransientError
from buildarena_store import Usage
from buildarena_worker.providers.provider import ProviderClient
from buildarena_worker.providers.retries import RetryPolicy
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall
from buildarena_worker.session.results import Failed

PROTOCOLS = ["openai", "anthropic", "google"]


def ask(text: str = "hello") -> Request:
    return Request(
        model_config={"decoding": {"temperature": 0.5, "top_p": 0.7}},
        messages=[Message(role="system", text="# Role: x"), Message(role="user", text=text)],
        seed=3,
    )


@pytest.mark.ci
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_whole_session_over_http_equals_the_one_played_inside(play, protocol, client) -> None:
    with ProviderStandIn() as standin:
        over_http = play(client=client(standin, protocol), workflow="five-role")
    inside = play(workflow="five-role")
    assert over_http.suspended is not None, over_http.failure
    assert over_http.suspended.machine.to_document() == inside.suspended.machine.to_document()
    used = sum((entry.usage for entry in over_http.entries), Usage())
    counts = standin.counts
    assert used.requests == counts.requests == counts.answered
    assert used.input_tokens == counts.input_tokens
    assert used.output_tokens == counts.output_tokens
    assert used.cached_tokens == counts.cached_tokens
    wanted = (
        2.0 * (counts.input_tokens - counts.cached_tokens)
        + 0.5 * counts.cached_tokens
        + 8.0 * counts.output_tokens
    ) / 1e6
    assert float(used.cost_usd) == pytest.approx(wanted, abs=1e-6 * counts.requests)


FAULTS = [
    (protocol, fault)
    for protocol in PROTOCOLS
    for fault in ("429", "429 gzip", "500", "503", "drop")
]


@pytest.mark.parametrize(("protocol", "fault"), FAULTS)
def test_passing_faults_are_retried(protocol, fault, client) -> None:
    with ProviderStandIn("idle", fault=lambda n: fault if n < 2 else None) as standin:
        answer = client(standin, protocol).complete(ask())
    assert answer.text == "TERMINATE"
    assert answer.attempts == 3
    assert answer.usage.requests == 1


def test_retries_are_bounded(client) -> None:
    with (
        ProviderStandIn("idle", fault=lambda _: "500") as standin,
        pytest.raises(TransientError, match="5 attempts failed") as caught,
    ):
        client(standin).complete(ask())
    assert standin.counts.requests == 5
    assert caught.value.reason == "provider_outage"


def test_a_silent_provider_times_out(client) -> None:
    policy = RetryPolicy(attempts=2, first_wait_s=0.01, timeout_s=0.3)
    with ProviderStandIn("idle", fault=lambda n: "slow" if n == 0 else None) as standin:
        answer = client(standin, policy=policy).complete(ask())
    assert answer.attempts == 2


@pytest.mark.parametrize(
    ("fault", "reason"), [("401", "bad_credentials"), ("404", "model_not_found")]
)
def test_refusals_that_stay_are_not_retried(fault, reason, client) -> None:
    with (
        ProviderStandIn("idle", fault=lambda _: fault) as standin,
        pytest.raises(PermanentError) as caught,
    ):
        client(standin).complete(ask())
    assert standin.counts.requests == 1
    assert caught.value.reason in {reason, "request_refused"}
    assert "secret" not in str(caught.value)


def test_a_missing_key_is_named() -> None:
    entry = ModelEntry(name="x/y", provider="x", model="y")
    provider = ProviderEntry(protocol="openai", base_url="http://127.0.0.1:9", key="NO_SUCH_KEY")
    with pytest.raises(PermanentError, match="NO_SUCH_KEY"):
        ProviderClient(entry, provider)


def test_decoding_and_seed_go_over_the_wire(client) -> None:
    with ProviderStandIn("idle") as standin:
        client(standin).complete(ask())
    (body,) = standin.counts.bodies
    assert (body["temperature"], body["top_p"], body["seed"]) == (0.5, 0.7, 3)


def test_every_request_carries_its_own_tools(client) -> None:
    def tool(name: str, unit: str) -> ToolDefinition:
        parameters = {"type": "object", "properties": {unit: {"type": "number"}}}
        return ToolDefinition(name=name, description=f"Moves by {unit}.", parameters=parameters)

    asked = [[tool("move", "metres")], [tool("move", "feet")], [tool("move", "metres")], []]
    with ProviderStandIn("idle") as standin:
        one = client(standin)
        for tools in asked:
            one.complete(replace(ask(), tools=tools))
    first, second, third, bare = standin.counts.bodies
    assert first == third
    assert "metres" in first["tools"][0]["function"]["parameters"]["properties"]
    assert "feet" in second["tools"][0]["function"]["parameters"]["properties"]
    assert first["parallel_tool_calls"] is False
    assert "tools" not in bare


def test_arguments_that_are_no_json_reach_the_session_as_text(client) -> None:
    def respond(_: Request) -> Completion:
        return Completion(text="", calls=(ToolCall(id="c", name="start", arguments=[1, "x"]),))

    with ProviderStandIn(respond=respond) as standin:
        answer = client(standin).complete(ask())
    (call,) = answer.calls
    assert call.arguments == [1, "x"]


def test_retry_after_is_honoured_within_bounds() -> None:

    policy, rng = RetryPolicy(longest_wait_s=60), random.Random(1)
    assert policy.wait_s(1, {"retry-after": "7"}, rng) == 7
    assert policy.wait_s(1, {"retry-after": "900"}, rng) == 60
    assert policy.wait_s(1, {"retry-after-ms": "250"}, rng) == 0.25
    assert all(4 <= policy.wait_s(4, None, rng) <= 8 for _ in range(20))
    assert policy.wait_s(20, {"retry-after": "soon"}, rng) <= 60


def overflow(_: int) -> str:
    return "overflow"


def test_an_overflowing_context_is_the_models_own_failure(play, client) -> None:
    with ProviderStandIn("idle", fault=overflow) as standin:
        failure = play(client=client(standin)).failure
    assert isinstance(failure, Failed)
    assert failure.reason == "context_overflow"
    assert standin.counts.requests == 1


@pytest.mark.parametrize("finish", ["length", "content_filter"])
def test_cut_and_filtered_replies_are_marked_in_the_transcript(play, client, finish) -> None:
    with ProviderStandIn(respond=lambda _: Completion(text="half a", finish=finish)) as standin:
        played = play(client=client(standin))
    assert [turn.finish for turn in played.session.transcript.turns] == [finish] * 5
    assert played.failure.reason == "plan_unreadable"


def test_sessions_get_through_a_provider_that_fails_one_request_in_five(play, client) -> None:
    kinds = ("429", "500", "503", "drop", "slow", "garbage")
    rng = random.Random(5)
    faults = [rng.choice(kinds) if rng.random() < 0.2 else None for _ in range(5000)]
    policy = RetryPolicy(attempts=8, first_wait_s=0.01, longest_wait_s=0.05, timeout_s=0.5)
    with (
        ProviderStandIn(fault=lambda n: faults[n % len(faults)]) as standin,
        ThreadPoolExecutor(4) as threads,
    ):
        one = client(standin, policy=policy)
        played = list(
            threads.map(lambda seed: play(client=one, workflow="builder", seed=seed), range(4))
        )
    assert all(p.suspended is not None for p in played), [p.failure for p in played]
    tries = [entry.tries for p in played for entry in p.entries]
    assert max(tries) <= policy.attempts
    assert sum(tries) == standin.counts.requests
    assert sum(tries) > 1.1 * len(tries)
