"""Built-in models, which need no key and use the same requests, tools and journal as others.

They are functions of what a model can read in a request, so they can also be served through a
provider's wire format. They are baselines, marked as such on leaderboards.
"""

from dataclasses import replace
from decimal import Decimal

from buildarena_backend.errors import PermanentError
from buildarena_backend.journal.journal import Usage
from buildarena_worker.builtin import expert, random_builder
from buildarena_worker.session.messages import UNBOUNDED, Completion, Request, RequestOptions


def _idle(_: Request) -> Completion:
    """End every task at once; the scores are the lower bound."""
    return Completion(text="TERMINATE")


MODELS = {"expert": expert.reply, "random": random_builder.reply, "idle": _idle}
CHARACTERS_PER_TOKEN = 4
"""A common rule of thumb for English text; built-in models have no tokenizer."""


class BuiltinClient:
    """Client that answers requests with a built-in model.

    Args:
        name: ``expert``, ``random`` or ``idle``.

    Raises:
        PermanentError: The name is unknown.
    """

    def __init__(self, name: str) -> None:
        if name not in MODELS:
            raise PermanentError(
                f"unknown model {name!r}; valid models: {', '.join(MODELS)}", reason="unknown_model"
            )
        self._reply = MODELS[name]

    def complete(self, request: Request, options: RequestOptions = UNBOUNDED) -> Completion:
        """Return the model's reply, with tokens estimated from its length and without cost."""
        del options
        completion = self._reply(request)
        sent = sum(len(message.text) for message in request.messages)
        called = sum(len(call.name) + len(str(call.arguments)) for call in completion.calls)
        usage = Usage(
            requests=1,
            input_tokens=sent // CHARACTERS_PER_TOKEN,
            output_tokens=max(1, (len(completion.text) + called) // CHARACTERS_PER_TOKEN),
            cost_usd=Decimal(),
        )
        return replace(completion, usage=usage)
