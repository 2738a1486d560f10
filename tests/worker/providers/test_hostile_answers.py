"""No shape of answer makes a session's worker fail, whichever protocol it comes over."""

import json
import math
import time
from dataclasses import asdict
from typing import Any

import pytest
from support.providers.scripted import Scripted
from support.providers.stand_in import ProviderStandIn

from buildarena_backend.database.text import clean
from buildarena_backend.errors import PermanentError, TransientError
from buildarena_worker.providers import response_limits
from buildarena_worker.providers.failures import ProviderError
from buildarena_worker.providers.openai.answer import AnswerReader
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall
from buildarena_worker.session.results import Failed
from buildarena_worker.workflow.plan import PlanError, parse_plan

PROTOCOLS = ["openai", "anthropic", "google"]
READER = AnswerReader("http://127.0.0.1:1/v1")
ASK = Request(
    model_config={"decoding": {}},
    messages=[Message(role="system", text="# Role: x"), Message(role="user", text="hello")],
)
LIES: list[Any] = [-5, True, 1.5, 10**30, "many", None, [1], {"a": 1}]


def test_no_protocol_follows_a_redirect(client, subtests) -> None:
    for protocol in PROTOCOLS:
        with subtests.test(protocol=protocol), ProviderStandIn() as thief:
            redirects = ProviderStandIn(fault=lambda _: "307", elsewhere=thief.url)
            refused = pytest.raises(PermanentError, match="HTTP 307: the provider redirects")
            with redirects as bad, refused as said:
                client(bad, protocol).complete(ASK)
            assert (bad.counts.requests, thief.counts.requests) == (1, 0)
            assert said.value.reason == "request_refused"


GARBAGE = [b"<html>", b"[]", b"[" * 100_000, b'{"a": "' + b"x" * (9 * 1024 * 1024) + b'"}']


def test_every_protocol_counts_garbage_once_per_request(client, subtests) -> None:
    for protocol in PROTOCOLS:
        for body in GARBAGE:
            if protocol == "google" and body == b"[]":
                continue  # a legal answer to its library: an empty reply
            with subtests.test(protocol=protocol, size=len(body)):
                with ProviderStandIn(fault=lambda _: body) as bad:
                    answer = client(bad, protocol).complete(ASK)
                    assert bad.counts.requests == 1
                assert (answer.finish, answer.usage.requests) == ("garbage", 1)


def test_every_protocol_charges_what_garbage_reports(client, subtests) -> None:
    for protocol, body in [
        ("openai", {"usage": {"prompt_tokens": 100, "completion_tokens": 50}}),
        ("anthropic", {"content": 5, "usage": {"input_tokens": 100, "output_tokens": 50}}),
        (
            "google",
            {
                "candidates": 5,
                "usageMetadata": {"promptTokenCount": 100, "candidatesTokenCount": 50},
            },
        ),
    ]:
        with subtests.test(protocol=protocol):
            with ProviderStandIn(fault=lambda _: json.dumps(body).encode()) as bad:
                answer = client(bad, protocol).complete(ASK)
            assert answer.finish == "garbage"
            assert (answer.usage.input_tokens, answer.usage.output_tokens) == (100, 50)


def read(message: dict[str, Any], usage: Any = None) -> Any:
    answer = {"id": "r", "model": "m", "choices": [{"message": message}], "usage": usage}
    return READER.read(200, {}, json.dumps(answer).encode())


def test_lies_about_usage_are_nothing_or_bounded(subtests) -> None:
    for lie in LIES:
        for name in ["prompt_tokens", "completion_tokens", "cached_tokens", "reasoning_tokens"]:
            with subtests.test(lie=lie, name=name):
                usage: dict[str, Any] = {"prompt_tokens": 100, "completion_tokens": 50}
                if name in usage:
                    usage[name] = lie
                else:
                    part = "prompt" if name == "cached_tokens" else "completion"
                    usage[f"{part}_tokens_details"] = {name: lie}
                used = asdict(read({"content": "x"}, usage).usage)
                del used["cost_usd"]
                for count in used.values():
                    assert type(count) is int
                    assert 0 <= count <= response_limits.MAX_TOKENS
                assert used["cached_tokens"] <= used["input_tokens"]


def test_lies_over_other_protocols_end_as_answers(client, subtests) -> None:
    said = {"id": "r", "type": "message", "role": "assistant", "model": "m"}
    said |= {"stop_reason": "end_turn", "content": [{"type": "text", "text": "x"}]}
    candidates = [{"content": {"role": "model", "parts": [{"text": "x"}]}}]
    anthropic = ("input_tokens", "output_tokens", "cache_read_input_tokens")
    google = ("promptTokenCount", "candidatesTokenCount")
    for lie in LIES:
        for protocol, body in (
            ("anthropic", {**said, "usage": dict.fromkeys(anthropic, lie)}),
            ("google", {"candidates": candidates, "usageMetadata": dict.fromkeys(google, lie)}),
        ):
            with subtests.test(lie=lie, protocol=protocol):
                data = json.dumps(body).encode()
                with ProviderStandIn(fault=lambda _, data=data: data) as bad:
                    usage = client(bad, protocol).complete(ASK).usage
                assert bad.counts.requests == usage.requests == 1
                assert 0 <= usage.input_tokens <= response_limits.MAX_TOKENS
                assert 0 <= usage.output_tokens <= response_limits.MAX_TOKENS
                assert 0 <= usage.cost_usd <= 100


def calling(*arguments: Any, name: Any = "start", id_: Any = "c") -> dict[str, Any]:
    made = [{"name": name, "arguments": given} for given in arguments]
    return {"tool_calls": [{"id": id_, "type": "function", "function": one} for one in made]}


ARGUMENTS = {
    "deep list": "[" * 100_000,
    "deep closed": "[" * 5000 + "]" * 5000,
    "deep object": '{"a":' * 40 + "1" + "}" * 40,
    "nan": '{"note": NaN}',
    "infinite": '{"note": 1e999}',
    "many digits": '{"note": ' + "9" * 5000 + "}",
    "long": json.dumps({"note": "x" * 1_000_000}),
    "wide": json.dumps({"note": list(range(100_000))}),
    "nul": '{"note": "\\u0000"}',
    "surrogate": '{"note": "\\ud800", "\\udfff": 1}',
    "object": {"note": [[[[1]]]]},
    "number": 7,
}


def test_arguments_of_any_shape_can_be_kept_and_sent_back(play, subtests) -> None:
    for name in ARGUMENTS:
        with subtests.test(name=name):
            reply = read(calling(ARGUMENTS[name]))
            kept = json.dumps(clean(reply.to_json()), allow_nan=False)
            assert len(kept) < 2 * response_limits.MAX_ARGUMENTS
            kept.encode()
            assert "\\u0000" not in kept

            played = play(workflow="builder", client=Scripted(reply))
            assert isinstance(played.failure, Failed), played.failure


def test_what_is_no_reply_is_garbage(subtests) -> None:
    for message in [
        calling("{}", name=7),
        calling("{}", name=None),
        calling("{}", name=["a"]),
        calling("{}", id_=None),
        calling("{}", id_={"a": 1}),
        {"content": {"a": 1}},
        {"tool_calls": "many"},
        {"tool_calls": {"a": 1}},
        {"tool_calls": [None]},
    ]:
        with subtests.test(message=message):
            with pytest.raises(ProviderError) as caught:
                read(message)
            assert caught.value.failure == "garbage"


def test_a_reply_is_cut_to_what_can_be_kept() -> None:
    reply = read({"content": "x" * 5_000_000, **calling(*["{}"] * 500, name="n" * 9999)})
    assert len(reply.text) == response_limits.MAX_TEXT
    assert reply.finish == "length"
    assert len(reply.calls) == response_limits.MAX_CALLS
    assert len(reply.calls[0].name) == response_limits.MAX_NAME


def test_many_thoughts_take_no_time(subtests) -> None:
    for text in ["<think>" * 10**6, "<think></think>" * 400_000]:
        with subtests.test(text=text):
            started = time.process_time()
            read({"content": text})
            assert time.process_time() - started < 1


def test_many_openings_of_a_plan_take_no_time() -> None:
    body = "<sub_structure>" * 17_000
    started = time.process_time()
    with pytest.raises(PlanError):
        parse_plan(f"<building_plan>{body}</building_plan>")
    same = "<sub_structure><name>a</name><function>b</function></sub_structure>" * 3800
    with pytest.raises(PlanError, match="stands for several"):
        parse_plan(f"<building_plan><overall_structure>x</overall_structure>{same}</building_plan>")
    assert time.process_time() - started < 1


def test_a_conversation_that_grows_without_end_fails(play) -> None:
    long = Completion(text="x" * response_limits.MAX_TEXT)
    played = play(workflow="builder", client=Scripted(last=long))
    assert isinstance(played.failure, Failed)
    assert played.failure.reason == "context_overflow"
    assert len(played.entries) < 12


def test_an_error_of_any_shape_is_an_error(client) -> None:
    body = json.dumps({"error": {"message": "\x00\ud800" * 9000, "code": ["x"]}}).encode()
    for text in (body, b"[" * 100_000, b"\xff", b"{" * 10):
        with pytest.raises(ProviderError, match="HTTP 500"):
            READER.read(500, {"retry-after": "nan"}, text)
    with ProviderStandIn(fault=lambda _: "500") as bad, pytest.raises(TransientError):
        client(bad).complete(ASK)


def test_bounded_arguments_are_plain() -> None:
    for given in (math.nan, {"a": math.inf}, {"a": {"b": object()}}):
        assert isinstance(response_limits.bounded_arguments(given), str)
    assert response_limits.bounded_arguments({1: (2,)}) == {"1": [2]}
    call = ToolCall(id="c", name="n", arguments={"a": [1, "x", None, True, 1.5]})
    assert response_limits.bounded(Completion(text="", calls=(call,))).calls == (call,)


def test_arguments_have_a_last_level(subtests) -> None:
    for inner in [1, [], {}, {"k": "v"}]:
        with subtests.test(inner=inner):
            deep = inner
            for _ in range(response_limits.MAX_DEPTH - isinstance(inner, list | dict)):
                deep = [deep]
            assert response_limits.bounded_arguments(deep) == deep
            assert isinstance(response_limits.bounded_arguments({"k": deep}), str)
            assert isinstance(response_limits.bounded_arguments([0, deep]), str)
