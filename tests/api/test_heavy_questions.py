"""Heavy questions wait for each other, and take no other caller's place."""

import asyncio
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import httpx
import pytest
from sqlalchemy import text
from support.clients.tenants import WITH_KEYS, new_tenant
from support.jobs import end_all
from support.servers.live_api import live_api
from support.servers.stacks import wait_until
from support.statements import statements_of

from buildarena_api.http.places import Places
from buildarena_api.http.problems import ProblemError
from buildarena_backend.catalog.specs import SweepSpec

MAX_WAITING = 64
BOARDS = (
    "/v1/leaderboard",
    *("/v1/jobs?text=x", "/v1/jobs?flag=invented", "/v1/jobs/summary"),
    "/v1/leaderboard/compare?first=builtin/idle&second=builtin/idle",
)
"""Questions that look through all jobs."""


def test_a_page_has_at_most_200_rows(api, submissions) -> None:
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], samples=201))
    page = api.get("/v1/jobs?limit=200").json()
    assert len(page["data"]) == 200
    rest = api.get("/v1/jobs", params={"limit": 200, "cursor": page["next_cursor"]}).json()
    assert len(rest["data"]) == 1
    for path in ("/v1/jobs", "/v1/sweeps", "/v1/workers"):
        answer = api.get(f"{path}?limit=201")
        assert answer.status_code == 422
        assert "200" in answer.json()["detail"]


@pytest.fixture
def board(context, submissions) -> None:
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], samples=2))
    end_all(context)


@pytest.mark.ci
@pytest.mark.usefixtures("board")
def test_a_light_question_is_answered_while_heavy_ones_wait_and_are_refused(context) -> None:
    path = "/v1/leaderboard"
    patient = {"timeout": 60, "limits": httpx.Limits(max_connections=None)}
    threads = ThreadPoolExecutor(MAX_WAITING + 8)
    served = live_api(context, **WITH_KEYS)
    with served as url, httpx.Client(base_url=url, **patient) as http, threads:
        greedy, other = new_tenant(http, "greedy"), new_tenant(http, "other")
        for who in (greedy, other):
            assert who.ask("GET", "/v1/leaderboard").status_code == 200
        with context.store.database.transaction() as locking:
            # While it lasts, nobody can read what changed on boards.
            locking.execute(text("LOCK TABLE board_changes IN ACCESS EXCLUSIVE MODE"))
            asked = [threads.submit(greedy.ask, "GET", path) for _ in range(MAX_WAITING + 6)]
            # One is being answered, and so many wait.
            wait_until(lambda: sum(one.done() for one in asked) == 5, 20, "five are refused")
            refused = [one.result() for one in asked if one.done()]
            assert {answer.status_code for answer in refused} == {429}
            assert all(int(answer.headers["retry-after"]) >= 1 for answer in refused)
            assert "you have 1 heavy questions" in refused[0].json()["detail"]
            # Light ones of the same caller too.
            for who in (greedy, other):
                assert who.ask("GET", "/v1/jobs?limit=20").status_code == 200
            locking.rollback()
        assert {one.result().status_code for one in asked} == {200, 429}
        assert other.ask("GET", path).status_code == 200


@pytest.mark.usefixtures("board")
def test_what_looks_through_all_jobs_takes_a_heavy_place(api) -> None:
    places = api.app.state.services.places
    taken: list[str] = []

    def noting(kind: str, of: Callable[[str], Any]) -> Callable[[str], Any]:
        def place(who: str) -> Any:
            taken.append(kind)
            return of(who)

        return place

    for kind, its in places.items():
        its.of = noting(kind, its.of)
    for path, kind in (
        *((path, "heavy") for path in BOARDS),
        *(("/v1/jobs", "ordinary"), ("/v1/sweeps", "ordinary"), ("/v1/jobs/job_1", "ordinary")),
        *(("/v1/leaderboard/export", "heavy"), ("/v1/sweeps/sweep_1/results", "heavy")),
        *(("/v1/jobs/job_1/replay", "heavy"), ("/v1/jobs/job_1/scene", "heavy")),
        ("/v1/jobs/job_1/trajectory", "trajectories"),
    ):
        taken.clear()
        api.get(path)
        assert taken == [kind], path


class Work:
    """Work of one kind, which lasts until it is let go."""

    def __init__(self, **given: Any) -> None:
        self.places = Places("questions", **given)
        self.going_on: list[tuple[str, asyncio.Event]] = []
        self.order: list[str] = []
        self.came = asyncio.Event()

    async def ask(self, who: str) -> None:
        async with self.places.of(who):
            done = asyncio.Event()
            self.order.append(who)
            self.going_on.append((who, done))
            self.came.set()
            await done.wait()

    async def until(self, number: int) -> None:
        while len(self.order) < number:
            self.came.clear()
            await self.came.wait()

    def end_one(self) -> None:
        self.going_on.pop(0)[1].set()


def test_callers_take_turns() -> None:
    async def play() -> None:
        work = Work(each=1, total=2)
        async with asyncio.TaskGroup() as group:
            # Every key of one owner is a caller of its own; together they have two places.
            for who in [*["a"] * 5, *["b"] * 5, "c", "d"]:
                group.create_task(work.ask(who))
            await work.until(2)
            assert Counter(work.order) == {"a": 1, "b": 1}
            for number in range(3, 13):
                work.end_one()
                await work.until(number)
                going = [who for who, _ in work.going_on]
                assert len(going) == len(set(going)) <= 2
            # Nobody had a second turn before all had a first.
            assert set(work.order[:4]) == {"a", "b", "c", "d"}
            while work.going_on:
                work.end_one()
        assert not work.places._own
        assert work.places._all.borrowed_tokens == 0

    asyncio.run(play())


def test_whoever_leaves_while_waiting_keeps_no_place() -> None:
    async def play() -> None:
        work = Work(each=1, total=1)
        first = asyncio.create_task(work.ask("a"))
        await work.until(1)
        leaving = [asyncio.create_task(work.ask(who)) for who in ("a", "b", "c")]
        await asyncio.sleep(0.01)
        staying = asyncio.create_task(work.ask("d"))
        await asyncio.sleep(0.01)
        for task in leaving:
            task.cancel()
        work.end_one()
        await asyncio.gather(*leaving, return_exceptions=True)
        await work.until(2)
        assert work.order == ["a", "d"]
        work.end_one()
        await asyncio.gather(first, staying)
        assert work.places._all.borrowed_tokens == 0

    asyncio.run(play())


def test_one_too_many_is_refused_by_whose_places_are_taken() -> None:
    async def play() -> None:
        work = Work(each=1, total=1)
        waiting = [asyncio.create_task(work.ask("a")) for _ in range(1 + MAX_WAITING)]
        await work.until(1)
        with pytest.raises(ProblemError, match="you have 1 questions going on") as raised:
            await work.ask("a")
        assert (raised.value.code.status, raised.value.headers) == (429, {"Retry-After": "2"})
        for task in waiting:
            task.cancel()
        streams = Work(each=1, total=2, waiting=0)
        open_ones = [asyncio.create_task(streams.ask(who)) for who in ("a", "b")]
        await streams.until(2)
        for who, status in (("a", 429), ("c", 503)):
            with pytest.raises(ProblemError) as raised:
                await streams.ask(who)
            assert raised.value.code.status == status
        streams.end_one()
        await open_ones[0]
        open_ones[0] = asyncio.create_task(streams.ask("c"))
        await streams.until(3)
        for task in open_ones:
            task.cancel()

    asyncio.run(play())


INVENTED = {"track": 422, "task": 422, "category": 422, "model": 422, "sweep": 404}


@pytest.mark.usefixtures("board")
def test_invented_names_fill_no_cache_and_cost_few_statements(api, context) -> None:
    cache = api.app.state.services.boards._answers
    first = api.get("/v1/leaderboard")
    pair = {"first": "builtin/idle", "second": "builtin/expert"}
    with statements_of(context.store.database.engine) as statements:
        for (name, status), kind in product(INVENTED.items(), ("", "/compare")):
            names, costs = pair if kind == "/compare" else {}, []
            for number in range(3):
                statements.clear()
                params = {**names, name: f"invented-{number}"}
                answer = api.get(f"/v1/leaderboard{kind}", params=params)
                assert answer.status_code == status, (name, kind)
                costs.append(len(statements))
            # One of them may take in what changed meanwhile.
            assert sorted(costs)[-2] <= 4, (name, kind, costs)
        for name in ("flag", "task", "model"):
            costs = []
            for _ in range(2):
                statements.clear()
                answer = api.get("/v1/jobs", params={name: "invented"})
                assert answer.status_code == 422
                assert answer.json()["errors"][0]["choices"]
                costs.append(len(statements))
            assert min(costs) <= 6, costs
    assert len(cache) == 1
    again = api.get("/v1/leaderboard", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304
