"""Answers mean what they meant to pydantic-ai and OpenAI's SDK when they were kept.

Except for what those let pass: redirects, and names and counts that are none.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from buildarena_worker.providers.failures import ProviderError
from buildarena_worker.providers.openai.answer import AnswerReader

KEPT = json.loads((Path(__file__).parents[3] / "data/openai.json").read_text())["answers"]
URL = "http://127.0.0.1:1/v1"
READERS = {url: AnswerReader(url) for url in {case.get("url", URL) for case in KEPT}}


def meaning(case: dict[str, Any]) -> dict[str, Any]:
    """What an answer means, in the form of the kept ones."""
    try:
        answered = READERS[case.get("url", URL)].read(case["status"], {}, case["body"].encode())
    except ProviderError as error:
        return {"failure": error.failure.value, "overloaded": error.overloaded}
    reply, usage = answered.to_json(), answered.usage
    for call in reply["calls"]:
        call[0] = "(made)" if len(str(call[0])) > 8 else call[0]
    return {
        "reply": reply,
        "tokens": [
            usage.input_tokens,
            usage.output_tokens,
            usage.cached_tokens,
            usage.reasoning_tokens,
        ],
        "id": answered.provider_request_id,
    }


def test_answers_mean_what_kept_ones_meant(subtests) -> None:
    for status in sorted({case["status"] for case in KEPT}):
        with subtests.test(status=status):
            cases = [case for case in KEPT if case["status"] == status]
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
