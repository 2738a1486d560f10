"""Whole sessions over every protocol, retries, keys."""

import itertools
import json
import os
import random
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from support.programs import captured
from support.providers.stand_in import ProviderStandIn

from buildarena_backend.catalog.models import (
    ModelEntry,
    ModelRegistry,
    Price,
    ProviderEntry,
    load_registry,
)
from buildarena_backend.errors import PermanentError, TransientError
from buildarena_backend.journal.journal import Usage
from buildarena_geometry import ToolDefinition
from buildarena_worker.providers.checking import check_keys, check_model
from buildarena_worker.providers.provider import ProviderClient, RetryPolicy
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
def test_a_whole_session_over_http_equals_the_one_played_inside(play, client, subtests) -> None:
    for protocol in PROTOCOLS:
        with subtests.test(protocol=protocol):
            with ProviderStandIn() as standin:
                over_http = play(client=client(standin, protocol), workflow="guidance-builder")
            inside = play(workflow="guidance-builder")
            assert over_http.suspended is not None, over_http.failure
            told, untold = (each.suspended.machine.to_document() for each in (over_http, inside))
            assert told == untold
            for body in standin.counts.bodies:
                assert is_strict(speakers(protocol, body)), speakers(protocol, body)
            used = sum((entry.usage for entry in over_http.entries), Usage())
            counts = standin.counts
            assert used.requests == counts.requests == counts.answered
            assert used.input_tokens == counts.input_tokens
            assert used.output_tokens == counts.output_tokens
            assert used.cached_tokens == counts.cached_tokens
            unkept = counts.input_tokens - counts.cached_tokens
            wanted = (2.0 * unkept + 0.5 * counts.cached_tokens + 8.0 * counts.output_tokens) / 1e6
            assert float(used.cost_usd) == pytest.approx(wanted, abs=1e-6 * counts.requests)


PASSING = ("429", "429 gzip", "500", "503", "drop")
FAULTS = [(protocol, fault) for protocol in PROTOCOLS for fault in PASSING]


def test_passing_faults_are_retried(client, subtests) -> None:
    for protocol, fault in FAULTS:
        with subtests.test(protocol=protocol):
            with ProviderStandIn("idle", fault=lambda n: fault if n < 2 else None) as standin:
                answer = client(standin, protocol).complete(ask())
            assert answer.text == "TERMINATE"
            assert answer.attempts == 3
            assert len(answer.failures) == 2
            assert answer.usage.requests == 1


def test_retries_are_bounded(client) -> None:
    standin = ProviderStandIn("idle", fault=lambda _: "500")
    with standin, pytest.raises(TransientError, match="5 attempts failed") as caught:
        client(standin).complete(ask())
    assert standin.counts.requests == 5
    assert caught.value.reason == "provider_outage"


def test_a_silent_provider_times_out(client) -> None:
    policy = RetryPolicy(attempts=2, first_wait_s=0.01, timeout_s=0.3)
    with ProviderStandIn("idle", fault=lambda n: "slow" if n == 0 else None) as standin:
        answer = client(standin, policy=policy).complete(ask())
    assert answer.attempts == 2


def test_an_operator_says_timeout_headers_and_further_fields(client, subtests) -> None:
    given = {"max_tokens": 77, "extra_body": {"chat_template_kwargs": {"thinking": False}}}
    for protocol in PROTOCOLS:
        with subtests.test(protocol=protocol), ProviderStandIn("idle") as standin:
            model = given if protocol != "google" else {"max_tokens": 77}
            asked = client(standin, protocol, model=model, headers={"X-Project": "bridges"})
            asked.complete(ask())
            (body,), (headers,) = standin.counts.bodies, standin.counts.headers
            assert headers["x-project"] == "bridges"
            assert "77" in json.dumps(body)
            if protocol != "google":
                assert body["chat_template_kwargs"] == {"thinking": False}
    with ProviderStandIn("idle", fault=lambda n: "slow" if n == 0 else None) as standin:
        answer = client(standin, policy=None, timeout_s=0.3).complete(ask())
    assert answer.attempts == 2
    with pytest.raises(ValidationError, match="seed, tools: the session writes that itself"):
        ModelEntry(name="x/y", provider="x", model="y", extra_body={"tools": [], "seed": 1})


def test_refusals_that_stay_are_not_retried(client, subtests) -> None:
    for fault, reason in [("401", "bad_credentials"), ("404", "model_not_found")]:
        with subtests.test(fault=fault):
            standin = ProviderStandIn("idle", fault=lambda _: fault)
            with standin, pytest.raises(PermanentError) as caught:
                client(standin).complete(ask())
            assert standin.counts.requests == 1
            assert caught.value.reason in {reason, "request_refused"}
            assert "secret" not in str(caught.value)


def test_secrets_that_a_provider_repeats_are_blotted_out(client, subtests) -> None:
    said = {"k": ["Bearer secret", 1], "secret": {"deep": "x-token-1"}}
    reply = Completion(
        text="You sent Authorization: Bearer secret and x-token-1.",
        calls=[ToolCall(id="1", name="secret", arguments=said)],
        finish="tool_call",
    )
    for protocol in PROTOCOLS:
        with subtests.test(protocol=protocol), ProviderStandIn(respond=lambda _: reply) as standin:
            headers = {"X-Token": "x-token-1"}
            answer = client(standin, protocol, headers=headers).complete(ask())
            kept = json.dumps(answer.to_json())
            assert "You sent Authorization: Bearer *** and ***." in kept
            assert not {"secret", "x-token-1"} & set(re.findall(r"[a-z0-9-]+", kept))


def test_a_model_is_checked_with_one_request(monkeypatch, subtests) -> None:
    monkeypatch.setenv("STANDIN_KEY", "secret")
    call = ToolCall(id="1", name="add", arguments={"a": 2, "b": 3})
    usage = Usage(requests=1, input_tokens=50, output_tokens=7)

    def findings(url: str, price: Price | None = None) -> list[tuple[bool, str]]:
        provider = ProviderEntry(protocol="openai", base_url=f"{url}/v1", key="STANDIN_KEY")
        entry = ModelEntry(name="x/y", provider="x", model="y", price=price)
        registry = ModelRegistry(models={"x/y": entry}, providers={"x": provider})
        return list(check_model(registry, "x/y"))

    for name, reply, price, fault in [
        ("fine", Completion(text="", calls=[call], usage=usage), Price(input=2, output=8), None),
        ("said 'It is 5.'", Completion(text="It is 5.", usage=usage), None, None),
        ("price is unknown", Completion(text="", calls=[call], usage=usage), None, None),
        ("no answer: x/y", Completion(text=""), None, "401"),
        (
            "instead of a = 2",
            Completion(text="", calls=[replace(call, arguments={"a": 9})]),
            None,
            None,
        ),
    ]:
        standin = ProviderStandIn(respond=lambda _, r=reply: r, fault=lambda _, f=fault: f)
        with subtests.test(name=name), standin:
            found = findings(standin.url, price)
            assert standin.counts.requests == 1
            faults = [text for is_fine, text in found if not is_fine]
            assert (not faults) == (name == "fine")
            assert name == "fine" or any(name in text for text in faults), found
    assert findings("http://127.0.0.1:9")[0][0] is False


def test_a_missing_key_is_named() -> None:
    entry = ModelEntry(name="x/y", provider="x", model="y")
    provider = ProviderEntry(protocol="openai", base_url="http://127.0.0.1:9", key="NO_SUCH_KEY")
    with pytest.raises(PermanentError, match="NO_SUCH_KEY"):
        ProviderClient(entry, provider)


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


def test_cut_and_filtered_replies_are_marked_in_the_transcript(play, client, subtests) -> None:
    for finish in ["length", "content_filter"]:
        with subtests.test(finish=finish):
            half = Completion(text="half a", finish=finish)
            with ProviderStandIn(respond=lambda _: half) as standin:
                played = play(client=client(standin))
            assert [turn.finish for turn in played.session.transcript.turns] == [finish] * 5
            assert played.failure.reason == "plan_unreadable"


def speakers(protocol: str, body: dict[str, Any]) -> list[str]:
    """Who speaks, message by message, as the protocol carries it."""
    if protocol == "google":
        kinds = {"model": "assistant", "user": "user"}
        first = [content["parts"][0] for content in body["contents"]]
        told = [kinds[content["role"]] for content in body["contents"]]
        return [
            "tool" if "functionResponse" in p else kind for p, kind in zip(first, told, strict=True)
        ]
    return [m["role"] for m in body["messages"] if m["role"] != "system"]


def is_strict(roles: list[str]) -> bool:
    """Whether nobody speaks twice in a row; a tool's result stands between a call and the next."""
    pairs = set(itertools.pairwise(roles))
    alike = pairs & {("user", "user"), ("assistant", "assistant")}
    return roles[0] == "user" and roles[-1] in {"user", "tool"} and not alike


OWN = """
models: [{name: own/big, provider: own, model: big}]
providers: {own: {protocol: openai, base_url: "http://vllm:8000/v1", key: OWN_API_KEY}}
"""


def test_keys_are_checked_those_that_no_provider_names_too(tmp_path) -> None:
    keys = {"GEMINI_API_KEY": "x", "GOOGLE_API_KEY": "y", "A": "z"}
    found = list(check_keys(load_registry(), keys, ["openai/gpt-5", "no/model"]))
    assert (True, "GOOGLE_API_KEY: available") in found
    missing = "neither OPENAI_API_KEY nor OPENAI_API_KEY_FILE is set"
    assert [text for is_fine, text in found if not is_fine] == [
        f"openai/gpt-5: {missing}",
        "GEMINI_API_KEY: belongs to no provider; see models.yaml",
        "no/model: unknown model",
    ]
    assert not any("google/" in text for _, text in found)
    models = tmp_path / "models.yaml"
    models.write_text(OWN)
    own = {"OWN_API_KEY_FILE": str(tmp_path / "none")}
    found = check_keys(load_registry(models), own, ())
    ((is_fine, text),) = [each for each in found if each[1].startswith("own/big")]
    assert is_fine, "nobody asked for this model"
    assert "No such file" in text


@pytest.mark.ci
def test_the_worker_says_what_is_wrong_without_starting() -> None:
    words = [sys.executable, "-m", "buildarena_worker", "--check", "openai/gpt-5"]
    environment = {"PATH": os.environ["PATH"], "GEMINI_API_KEY": "x"}
    done = captured(words, env=environment)
    assert done.returncode == 1, done.stderr
    assert "GEMINI_API_KEY: belongs to no provider" in done.stdout
    assert "openai/gpt-5: neither OPENAI_API_KEY nor" in done.stdout


def test_what_the_compose_file_offers_are_keys_of_providers() -> None:
    offered = (Path(__file__).parents[3] / "deploy/docker/providers.env").read_text()
    variables = {line.strip("# =\n") for line in offered.splitlines() if line.endswith("=")}
    assert variables == {p.key for p in load_registry().providers.values() if p.key}
