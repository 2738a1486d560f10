"""What goes to OpenAI's protocol and what comes back."""

import json
from pathlib import Path
from typing import Any

import pytest

from buildarena_backend.catalog.models import ModelEntry, load_registry
from buildarena_geometry import ToolDefinition
from buildarena_worker.providers.failures import ProviderError
from buildarena_worker.providers.openai.answer import AnswerReader
from buildarena_worker.providers.openai.sender import function_tool, request_body
from buildarena_worker.session.dialogue import OBJECTION
from buildarena_worker.session.messages import Message, Request, ToolCall
from buildarena_worker.workflow.analyst import BREAKS, TRAJECTORY, TRANSCRIPT
from buildarena_worker.workflow.machine_tools import ASSEMBLE, BUILD, QUERIES, REFINE, tools_named

STORED = json.loads((Path(__file__).parents[2] / "data/openai.json").read_text())
KEPT = STORED["requests"]
CALL = ToolCall(id="c1", name="start", arguments={"block": "Wüfel", "n": 1.5})
TALK = [
    Message(role="system", text="Build."),
    Message(role="user", text="Go on \N{EN DASH} please"),
    Message(role="assistant", text="I start.", calls=(CALL,)),
    Message(role="tool", text="[OK]", call_id="c1", tool="start"),
    Message(role="user", text="more"),
    Message(role="user", text="and more"),
    Message(role="assistant", text="", calls=(ToolCall(id="c2", name="x", arguments="no"),)),
    Message(role="tool", text="[ERR]", call_id="c2", tool="x"),
    Message(role="assistant", text="(no answer)"),
    Message(role="assistant", text=""),
    Message(role="user", text="end"),
]
DECODING: dict[str, dict[str, Any]] = {"plain": {}, "cool": {"temperature": 0}}
DECODING |= {"sampled": {"temperature": 0.5, "top_p": 0.9}, "short": {"max_tokens": 100}}
DECODING["all"] = {"temperature": 0.7, "top_p": 0.95, "max_tokens": 4096}


def closed(**properties: Any) -> dict[str, Any]:
    """An object with these properties and no others."""
    required = list(properties)
    schema = {"type": "object", "properties": properties, "required": required}
    return {**schema, "additionalProperties": False}


TEXT, NUMBER, NUMBERS = {"type": "string"}, {"type": "number"}, {"type": "number"}
POINT = {**closed(x=NUMBER), "title": "P"}
ODD = {
    "bare": {"type": "object"},
    "titled": {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "T",
        **closed(a={"title": "A", "type": "string", "default": "x"}),
    },
    "optional": {**closed(a=TEXT, b={"type": "integer"}), "required": ["a"]},
    "closed": closed(
        a={"type": "string", "enum": ["x", "y"]}, v={"type": "array", "items": NUMBERS}
    ),
    "open": {"type": "object", "properties": {"a": TEXT}, "required": ["a"]},
    "tuple": closed(
        v={"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3}, u={"type": "array"}
    ),
    "union": closed(
        v={"anyOf": [TEXT, {"type": "null"}]}, w={"oneOf": [TEXT, {"type": "integer"}]}
    ),
    "nested": closed(v=closed(x={"type": "number", "minimum": 0})),
    "refs": {
        "$defs": {"P": POINT},
        **closed(p={"$ref": "#/$defs/P", "description": "a point"}, q={"$ref": "#/$defs/P"}),
    },
    "pattern": closed(s={"type": "string", "pattern": "^a", "format": "uri", "minLength": 1}),
}
TOOLS = {
    "bare": [],
    "build": tools_named(BUILD),
    "build solo": [*tools_named(BUILD), OBJECTION],
    "refine": tools_named(REFINE),
    "assemble": tools_named(ASSEMBLE),
    "objection": [OBJECTION],
    "analyst": [*tools_named(QUERIES), TRANSCRIPT, TRAJECTORY, BREAKS],
    "odd": [
        ToolDefinition(
            name=name,
            description="Nothing at all." if name == "bare" else "d",
            parameters=parameters,
        )
        for name, parameters in ODD.items()
    ],
}


def test_requests_carry_what_kept_ones_carried(subtests) -> None:
    for case in KEPT["requests"]:
        with subtests.test(case=case):
            tools = TOOLS[case["tools"]]
            for sampling in case["sampling"]:
                entry = ModelEntry(name="own/m", provider="own", model="m", sampling=sampling)
                for seed in (case["sent"]["seed"], 77):  # the second has its frame already
                    config = {"decoding": DECODING[case["decoding"]]}
                    request = Request(model_config=config, messages=TALK, tools=tools, seed=seed)
                    body = json.loads(request_body(entry, request))
                    wanted = {**case["sent"], "model": "m", "seed": seed}
                    wanted["messages"] = KEPT["messages"]
                    if tools:
                        wanted["tools"] = KEPT["tools"][case["tools"]]
                    assert body == wanted


def test_only_models_that_take_them_are_sent_temperature_and_top_p() -> None:
    models = load_registry().models.values()
    assert [entry.name for entry in models if not entry.sampling] == ["openai/gpt-5"]


def test_schemas_are_written_as_kept_ones_were() -> None:
    for case in STORED["schemas"]:
        function = function_tool("t", "d", case["given"])["function"]
        found = {"sent": function["parameters"], "strict": function.get("strict", False)}
        assert found == {"sent": case["sent"], "strict": case["strict"]}, case["given"]


KEPT_ANSWERS = json.loads((Path(__file__).parents[2] / "data/openai.json").read_text())["answers"]
URL = "http://127.0.0.1:1/v1"
READERS = {url: AnswerReader(url) for url in {case.get("url", URL) for case in KEPT_ANSWERS}}


def meaning(case: dict[str, Any]) -> dict[str, Any]:
    """What an answer means, in the form of the kept ones."""
    try:
        answered = READERS[case.get("url", URL)].read(case["status"], {}, case["body"].encode())
    except ProviderError as error:
        return {"failure": error.failure.value, "overloaded": error.overloaded}
    reply, usage = answered.to_json(), answered.usage
    for call in reply["calls"]:
        call[0] = "(made)" if len(str(call[0])) > 8 else call[0]
    tokens = [usage.input_tokens, usage.output_tokens, usage.cached_tokens]
    tokens.append(usage.reasoning_tokens)
    return {"reply": reply, "tokens": tokens, "id": answered.provider_request_id}


def test_answers_mean_what_kept_ones_meant(subtests) -> None:
    for status in sorted({case["status"] for case in KEPT_ANSWERS}):
        with subtests.test(status=status):
            cases = [case for case in KEPT_ANSWERS if case["status"] == status]
            found = {case["name"]: meaning(case) for case in cases}
            assert found == {case["name"]: case["means"] for case in cases}


def test_an_error_says_what_the_provider_said(subtests) -> None:
    for body, says in [
        ({"error": {"message": "No such thing.\nAsk again.", "code": "x"}}, "HTTP 400: No such"),
        ({"detail": "odd"}, 'HTTP 400: {"detail": "odd"}'),
        ("", "HTTP 400: no reason given"),
        ({"error": {"message": "Odd.", "code": {"a": 1}, "type": "x"}}, "HTTP 400: Odd."),
    ]:
        with subtests.test(body=body):
            text = body if isinstance(body, str) else json.dumps(body)
            with pytest.raises(ProviderError, match=r"^HTTP 400") as caught:
                READERS[URL].read(400, {"retry-after": "3"}, text.encode())
            assert str(caught.value).startswith(says)
            assert caught.value.headers == {"retry-after": "3"}
