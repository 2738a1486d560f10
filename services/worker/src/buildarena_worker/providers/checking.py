"""Checks of models before sessions use them: providers' keys, and a test request."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
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
    entry = registry.models.get(name)
    if entry is None:
        yield False, f"unknown model {name!r}; valid models: {', '.join(registry.models)}"
        return
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


def check_keys(
    registry: ModelRegistry, environment: Mapping[str, str], required: Sequence[str]
) -> Iterator[tuple[bool, str]]:
    """Yield findings on providers' keys: whether each is good, and a sentence.

    A key that belongs to no provider is bad, and so is a missing one of a required model.
    """
    available: set[str] = set()
    for model in registry.models.values():
        variable = registry.provider_of(model).key
        if variable is None:
            continue
        reason = f"neither {variable} nor {variable}{SUFFIX} is set"
        try:
            if read_secret(variable, environment) is not None:
                available.add(variable)
                continue
        except SecretFileError as error:
            reason = str(error)
        yield model.name not in required, f"{model.name}: {reason}"
    yield from ((True, f"{variable}: available") for variable in sorted(available))
    valid = {provider.key for provider in registry.providers.values()}
    for name, value in sorted(environment.items()):
        if value and LOOKS_LIKE_A_KEY.match(name) and name.removesuffix(SUFFIX) not in valid:
            yield False, f"{name}: belongs to no provider; see models.yaml"
    yield from (
        (False, f"{name}: unknown model") for name in required if name not in registry.models
    )
