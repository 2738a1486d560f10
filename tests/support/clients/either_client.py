"""Both clients behind one face, so that one test speaks of both."""

import asyncio
import inspect
from collections.abc import AsyncIterator, Iterator
from typing import Any

from buildarena_client import AsyncClient, Client


class EitherClient:
    """A client whose methods answer at once, whichever it is."""

    def __init__(self, kind: str, url: str | None = None, key: str | None = None, **more: Any):
        self.made: Any = (AsyncClient if kind == "async" else Client)(url, key, **more)
        self._loop = asyncio.new_event_loop() if kind == "async" else None

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.made, name)
        if self._loop is None or not callable(found):
            return found

        def call(*given: Any, **named: Any) -> Any:
            answer = found(*given, **named)
            if inspect.isasyncgen(answer):
                return self._in_turn(answer)
            return self._loop.run_until_complete(answer) if inspect.isawaitable(answer) else answer

        return call

    def _in_turn(self, answers: AsyncIterator[Any]) -> Iterator[Any]:
        assert self._loop is not None
        nothing = object()
        try:
            while (one := self._loop.run_until_complete(anext(answers, nothing))) is not nothing:
                yield one
        finally:
            self._loop.run_until_complete(answers.aclose())  # type: ignore[attr-defined]

    def end(self) -> None:
        """Closes everything."""
        if self._loop is None:
            self.made.close()
        else:
            self._loop.run_until_complete(self.made.close())
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
            self._loop.run_until_complete(self._loop.shutdown_default_executor())
            self._loop.close()
