"""Checks of models before sessions use them: providers' keys, and a test request."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Final

from buildarena_backend.catalog.models import BUILTIN_PROTOCOL, ModelRegistry
from buildarena_backend.catalog.prices import listed_price
from buildarena_backend.catalog.specs import Decoding
from buildarena_backend.errors import PipelineError
from buildarena_backend.secret_files import SUFFIX, SecretFileError, read_secret
from buildarena_backend.submission.submission import model_config
from buildarena_geometry import ToolDefinition, object_schema
from buildarena_worker.providers.provider import ProviderClient, RetryPolicy
from buildarena_worker.session.messages import Completion, Message, Request

LOOKS_LIKE_A_KEY: Final = re.compile(rf"^\w+_API_KEY(?:{SUFFIX})?$")
PATIENCE_S: Final = 60.0
_TOOL: Final = ToolDefinition(
    name="add",
    description="Add two whole numbers.",
    parameters=object_schema({"a": {"type": "integer"}, "b": {"type": "integer"}}, ["a", "b"])
    | {"additionalProperties": False},
)
_PROMPT: Final = "Call the tool `add` with a = 2 and b = 3. Say nothing else."


def check_model(registry: ModelRegistry, name: str) -> Iterator[tuple[bool, str]]:
    """Send one request, and yield findings: whether each is good, and a sentence."""
    entry = registry.models[name]
    provider = registry.provider_of(entry)
    if provider.protocol == BUILTIN_PROTOCOL:
        yield True, f"{name} is built in and has no endpoint"
        return
    policy = RetryPolicy(attempts=1, timeout_s=min(PATIENCE_S, provider.timeout_s))
    request = Request(
        model_config=model_config(registry, name, Decoding()),
        messages=[Message(role="user", text=_PROMPT)],
        tools=[_TOOL],
    )
    try:
        with closing(ProviderClient(entry, provider, policy)) as client:
            completion = client.complete(request)
    except PipelineError as error:
        yield False, f"no answer: {error}"
        return
    yield True, f"it answered in {completion.latency_s:.1f} s"
    yield _judge_call(completion)
    used = completion.usage
    if used.input_tokens and used.output_tokens:
        yield True, f"it counts tokens: {used.input_tokens} in, {used.output_tokens} out"
    else:
        yield False, "it reports no tokens: budgets in tokens and dollars cannot count its requests"
    price = listed_price(entry)
    if price is None:
        yield False, "its price is unknown and counts as $0: give `price` in the models file"
    else:
        yield True, f"$ {price.input:g} in and {price.output:g} out per million tokens"


def _judge_call(completion: Completion) -> tuple[bool, str]:
    if not completion.calls:
        text = " ".join(completion.text.split())[:80]
        return False, f"it called no tool, and said {text!r} (it stopped by {completion.finish})"
    (call, *_others) = completion.calls
    if call.name != _TOOL.name or not isinstance(call.arguments, dict):
        return False, f"it called {call.name!r} with {str(call.arguments)[:80]!r}: no JSON object"
    arguments = {name: call.arguments.get(name) for name in ("a", "b")}
    if arguments != {"a": 2, "b": 3}:
        return False, f"it called `add` with {arguments} instead of a = 2 and b = 3"
    return True, "it called the tool as it should"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyReport:
    """Report on providers' keys.

    Attributes:
        available: Variables of keys that can be read.
        without: Reasons why models can't be reached, by the models' names.
        unused: Variables that look like keys but belong to no provider.
    """

    available: tuple[str, ...]
    without: Mapping[str, str]
    unused: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the report for people, a line for each fault."""
        lines = [f"{variable}: available" for variable in self.available]
        lines += [f"{model}: {reason}" for model, reason in self.without.items()]
        return lines + [f"{each}: belongs to no provider; see models.yaml" for each in self.unused]


def key_report(registry: ModelRegistry, environment: Mapping[str, str]) -> KeyReport:
    """Find the key of each provider that has models, and keys that belong to no provider."""
    available: set[str] = set()
    without: dict[str, str] = {}
    for model in registry.models.values():
        variable = registry.provider_of(model).key
        if variable is None:
            continue
        try:
            if read_secret(variable, environment) is None:
                without[model.name] = f"neither {variable} nor {variable}{SUFFIX} is set"
            else:
                available.add(variable)
        except SecretFileError as error:
            without[model.name] = str(error)
    valid = {provider.key for provider in registry.providers.values()}
    unused = (
        name
        for name, value in environment.items()
        if value and LOOKS_LIKE_A_KEY.match(name) and name.removesuffix(SUFFIX) not in valid
    )
    return KeyReport(
        available=tuple(sorted(available)), without=without, unused=tuple(sorted(unused))
    )
