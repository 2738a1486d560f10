"""Models for session tests: some reply as scripted, some remember what they were asked."""

from dataclasses import replace

from buildarena_backend.journal.journal import Usage
from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.session.messages import Completion, Request, ToolCall


class Scripted:
    """A model that says given things in turn, then one thing forever."""

    def __init__(self, *replies: Completion, last: Completion | None = None) -> None:
        self.replies = list(replies)
        self.last = last or Completion(text="TERMINATE")
        self.requests: list[Request] = []

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        self.requests.append(request)
        reply = self.replies.pop(0) if self.replies else self.last
        usage = Usage(requests=1, input_tokens=10, output_tokens=5)
        return replace(reply, usage=usage, latency_s=1.0)


def call(name: str, /, **arguments: object) -> Completion:
    return Completion(text="", calls=(ToolCall(id="c1", name=name, arguments=arguments),))


class Recording:
    """A built-in model, with every request kept."""

    def __init__(self, name: str = "expert") -> None:
        self._model = BuiltinClient(name)
        self.requests: list[Request] = []

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        self.requests.append(request)
        return self._model.complete(request)
