"""Both clients: the endpoints of the API as coroutines, and as methods that carry those out."""

from __future__ import annotations

import functools
from collections.abc import AsyncGenerator, Callable, Coroutine, Generator
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from buildarena_client.endpoints.base import TIMEOUT_S
from buildarena_client.endpoints.boards import Boards
from buildarena_client.endpoints.catalogue import Catalogue
from buildarena_client.endpoints.jobs import Jobs
from buildarena_client.endpoints.sessions import Sessions
from buildarena_client.endpoints.sweeps import Sweeps
from buildarena_client.retries import RetryPolicy

P = ParamSpec("P")
T = TypeVar("T")


class Api(Catalogue, Boards, Jobs, Sweeps, Sessions):
    """All endpoints of the API, as coroutines."""


class AsyncClient(Api):
    """The API of a service: the methods of ``Client``, awaited.

    Args:
        url: Address, for example ``http://127.0.0.1:8321``. Defaults to BUILDARENA_URL.
        key: API key. Defaults to the one in BUILDARENA_KEY, or in the file that BUILDARENA_KEY_FILE
            names, if any.
        timeout_s: Maximum silence of the server during a request, seconds.
        retries: Limits for repeating requests. Defaults to `RetryPolicy()`.
        at_once: Maximum number of open requests; further ones wait. Downloads and streams are not
            counted.

    Raises:
        BadArgumentError: The URL or the key is invalid.
    """

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_error: object) -> None:
        await self.close()


def run(coroutine: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine that blocks and never suspends, without an event loop, and return its result.

    Raises:
        RuntimeError: It suspends: its transport is not a blocking one.
    """
    try:
        coroutine.send(None)
    except StopIteration as ended:
        result: T = ended.value
        return result
    coroutine.close()
    raise RuntimeError("the transport of a synchronous client must block")


def _call(
    method: Callable[Concatenate[Api, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[Client, P], T]:
    """Return the synchronous form of a method."""

    @functools.wraps(method)
    def call(self: Client, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self._run(method(self._api, *args, **kwargs))

    return call


def _iteration(
    method: Callable[Concatenate[Api, P], AsyncGenerator[T, None]],
) -> Callable[Concatenate[Client, P], Generator[T, None, None]]:
    """Return the synchronous form of a method that yields several results."""

    @functools.wraps(method)
    def iterate(self: Client, /, *args: P.args, **kwargs: P.kwargs) -> Generator[T, None, None]:
        return self._iterate(method(self._api, *args, **kwargs))

    return iterate


class Client:
    """The API of a service.

    Any thread may use it. A request that changes something is sent once. It is sent again only
    after the service rejected it because of a rate limit (429), or if a repetition has no effect.
    Responses are the API's documents, typed as in ``buildarena_client.schemas``; new fields can be
    added, so nothing validates them. ``get``, ``post`` and ``put`` send requests that no method
    covers. All methods raise ``ClientError``.

    Args:
        url: Address, for example ``http://127.0.0.1:8321``. Defaults to BUILDARENA_URL.
        key: API key. Defaults to the one in BUILDARENA_KEY, or in the file that BUILDARENA_KEY_FILE
            names, if any.
        timeout_s: Maximum silence of the server during a request, seconds.
        retries: Limits for repeating requests. Defaults to `RetryPolicy()`.

    Raises:
        BadArgumentError: The URL or the key is invalid.
    """

    def __init__(
        self,
        url: str | None = None,
        key: str | None = None,
        *,
        timeout_s: float | None = TIMEOUT_S,
        retries: RetryPolicy | None = None,
    ) -> None:
        self._api = Api(url, key, timeout_s=timeout_s, retries=retries, at_once=None)

    @property
    def url(self) -> str:
        """Address of the service."""
        return self._api.url

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.url!r})"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def _run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run every method's coroutine, except those that iterate."""
        return run(coroutine)

    def _iterate(self, answers: AsyncGenerator[T, None]) -> Generator[T, None, None]:
        try:
            while True:
                try:
                    answer = self._run(answers.__anext__())
                except StopAsyncIteration:
                    return
                yield answer
        finally:
            self._run(answers.aclose())

    close = _call(Api.close)
    get = _call(Api.get)
    get_bytes = _call(Api.get_bytes)
    get_patiently = _call(Api.get_patiently)
    every = _call(Api.every)
    post = _call(Api.post)
    put = _call(Api.put)
    upload = _call(Api.upload)
    download = _call(Api.download)
    pages = _iteration(Api.pages)

    health = _call(Api.health)
    caller = _call(Api.caller)
    tasks = _call(Api.tasks)
    task = _call(Api.task)
    add_task = _call(Api.add_task)
    models = _call(Api.models)
    scorers = _call(Api.scorers)
    versions = _call(Api.versions)
    simulators = _call(Api.simulators)
    modules = _call(Api.modules)
    workers = _iteration(Api.workers)

    leaderboard = _call(Api.leaderboard)
    compare = _call(Api.compare)
    verify_leaderboard = _call(Api.verify_leaderboard)
    export_leaderboard = _call(Api.export_leaderboard)

    jobs = _iteration(Api.jobs)
    job_summary = _call(Api.job_summary)
    search_transcripts = _iteration(Api.search_transcripts)
    job = _call(Api.job)
    submit_job = _call(Api.submit_job)
    cancel_job = _call(Api.cancel_job)
    retry_job = _call(Api.retry_job)
    verify_job = _call(Api.verify_job)
    verification = _call(Api.verification)
    wait_for_job = _call(Api.wait_for_job)
    wait_for_verification = _call(Api.wait_for_verification)
    transcript = _call(Api.transcript)
    prompts = _call(Api.prompts)
    machine = _call(Api.machine)
    replay = _call(Api.replay)
    machine_model = _call(Api.machine_model)
    thumbnail = _call(Api.thumbnail)
    scene = _call(Api.scene)
    trajectory = _call(Api.trajectory)
    artifacts = _call(Api.artifacts)
    artifact = _call(Api.artifact)
    download_artifact = _call(Api.download_artifact)
    job_events = _iteration(Api.job_events)

    sweeps = _iteration(Api.sweeps)
    sweep = _call(Api.sweep)
    submit_sweep = _call(Api.submit_sweep)
    estimate_sweep = _call(Api.estimate_sweep)
    pause_sweep = _call(Api.pause_sweep)
    resume_sweep = _call(Api.resume_sweep)
    set_sweep_budget = _call(Api.set_sweep_budget)
    sweep_forecast = _call(Api.sweep_forecast)
    cancel_sweep = _call(Api.cancel_sweep)
    retry_sweep = _call(Api.retry_sweep)
    sweep_results = _call(Api.sweep_results)
    sweep_faults = _call(Api.sweep_faults)
    sweep_events = _iteration(Api.sweep_events)
    watch_sweep = _iteration(Api.watch_sweep)
    wait_for_sweep = _call(Api.wait_for_sweep)

    open_session = _call(Api.open_session)
    session = _call(Api.session)
    session_machine = _call(Api.session_machine)
    call_tool = _call(Api.call_tool)
    test_session = _call(Api.test_session)
    submit_session = _call(Api.submit_session)
    check_machine = _call(Api.check_machine)
    try_machine = _call(Api.try_machine)
