"""Heavy questions cost their caller more, and take no other caller's place."""

import asyncio
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import httpx
import pytest
from sqlalchemy import text
from support.clients.tenants import WITH_KEYS, new_tenant
from support.jobs import execute
from support.servers.live_api import api_client, changed, live_api
from support.servers.stacks import wait_until
from support.statements import statements_of

from buildarena_api.app import all_routes
from buildarena_api.http.concurrency import MAX_WAITING, ConcurrencyLimit, usual_limits
from buildarena_api.http.problems import ProblemError
from buildarena_api.http.weights import HEAVIEST, MAX_QUERY_BYTES, Weight, Weights
from buildarena_backend.catalog.specs import SweepSpec

LIGHT_PATHS = (
    *("/v1/jobs", "/v1/jobs?limit=100&task=lift-1", "/v1/jobs/job_1", "/v1/sweeps", "/v1/caller"),
    *("/v1/leaderboard/changes", "/v1/nothing?limit=1000"),
)
HEAVY_PATHS = {
    "/v1/jobs?limit=101": 2,
    "/v1/jobs?limit=1000&cursor=abc": 10,
    "/v1/jobs?text=&limit=1": 11,
    "/v1/jobs?text=b&sort=cost&order=asc&limit=1000": 20,
    "/v1/jobs?flag=invented": 11,
    "/v1/leaderboard": 2,
    "/v1/leaderboard?model=invented": 5,
    "/v1/leaderboard?task=invented&task=other": 5,
    "/v1/leaderboard/figures?sweep=invented": 20,
    "/v1/leaderboard/compare?first=a&second=b": 10,
    "/v1/leaderboard/compare?first=a&second=b&until=2025-01-01": 20,
    "/v1/leaderboard/changes?limit=1000": 10,
    "/v1/leaderboard/manifest?task=lift-1&model=a": 5,
    "/v1/leaderboard/export": 20,
    "/v1/sweeps/sweep_1/results": 20,
    "/v1/sweeps?limit=100": 5,
    "/v1/jobs/job_1/replay": 5,
    "/v1/jobs/job_1/scene?number=3": 3,
}
LIMITS = (
    *("limit=%31000", "%6Cimit=1000", "limit=1000.0", "limit=%2B1000", "limit=1_000"),
    *("limit=%201000", "limit=01000", "limit=%D9%A1%D9%A0%D9%A0%D9%A0", "limit=20&limit=1000"),
    f"limit=1000&since=2025-01-01T00:00:00Z&task={'x' * MAX_QUERY_BYTES}",
)
"""Ways to spell a thousand."""


@pytest.fixture(scope="module")
def weights() -> Weights:
    return Weights(all_routes())


def weighed(weights: Weights, path: str, method: str = "GET") -> Weight:
    place, _, query = path.partition("?")
    return weights.of({"method": method, "path": place, "query_string": query.encode()})


def test_questions_weigh_what_they_cost_in_lanes_that_have_limits(weights) -> None:
    assert [path for path in LIGHT_PATHS if not weighed(weights, path).is_light] == []
    found = {path: weighed(weights, path) for path in HEAVY_PATHS}
    assert found == {path: Weight(units=units, lane="heavy") for path, units in HEAVY_PATHS.items()}
    for path in ("/v1/machines/check", "/v1/machines/trials?task=lift-1"):
        assert weighed(weights, path, "POST") == Weight(units=HEAVIEST, lane="files")
        assert weighed(weights, path, "GET").is_light
    for lane in ("heavy", "files"):
        assert isinstance(getattr(usual_limits(), lane), ConcurrencyLimit)


def test_no_spelling_of_many_rows_is_light(api, weights, submissions) -> None:
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], samples=150))
    for limit in LIMITS:
        answer = api.get(f"/v1/jobs?{limit}")
        brings_many = answer.status_code == 200 and len(answer.json()["jobs"]) > 100
        assert not (brings_many and weighed(weights, f"/v1/jobs?{limit}").is_light), limit


def test_a_weight_is_taken_from_the_callers_rate(context) -> None:
    path, light = "/v1/jobs?limit=1000", "/v1/jobs?limit=20"
    with (
        changed(context, **{**WITH_KEYS, "rate_limit": "25/minute"}) as own,
        api_client(own) as client,
    ):
        mine, other = new_tenant(client, "mine"), new_tenant(client, "other")
        assert [mine.ask("GET", path).status_code for _ in range(2)] == [200, 200]
        refused, early = (mine.ask("GET", path) for _ in range(2))
        assert refused.status_code == early.status_code == 429
        assert refused.headers["content-type"] == "application/problem+json"
        assert int(refused.headers["retry-after"]) >= 1
        assert "weighs 10, 5 are left" in refused.json()["detail"]
        assert "came too early" in early.json()["detail"]
        # What is left is enough for light ones, and another's is untouched.
        assert [mine.ask("GET", light).status_code for _ in range(6)] == [200] * 5 + [429]
        assert other.ask("GET", path).status_code == 200
    with changed(context, rate_limit="5/minute") as own, api_client(own) as client:
        # What weighs more than the rate can be asked once.
        path = "/v1/leaderboard?since=2025-01-01T00:00:00Z"
        assert [client.get(path).status_code for _ in range(2)] == [200, 429]


@pytest.fixture
def board(context, submissions) -> None:
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], samples=2))
    execute(
        context,
        "UPDATE jobs SET state = 'done', outcome = 'unsuccessful', success = false,"
        " indicator = 0, metrics = '{}', finished_at = now()",
    )


@pytest.mark.ci
@pytest.mark.usefixtures("board")
def test_a_light_question_is_answered_while_heavy_ones_wait_and_are_refused(context) -> None:
    path = "/v1/leaderboard/changes?limit=1000"
    with (
        changed(context, **WITH_KEYS) as own,
        live_api(own) as url,
        httpx.Client(base_url=url, timeout=60, limits=httpx.Limits(max_connections=None)) as http,
        ThreadPoolExecutor(MAX_WAITING + 8) as threads,
    ):
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
            told = [answer.json()["detail"] for answer in refused]
            assert any("heavy questions" in one and "weighs 10" in one for one in told)
            # Light ones of the same caller too.
            for who in (greedy, other):
                assert who.ask("GET", "/v1/jobs?limit=20").status_code == 200
            locking.rollback()
        assert {one.result().status_code for one in asked} == {200, 429}
        assert other.ask("GET", path).status_code == 200


class Lane:
    """A lane whose questions last until they are let go."""

    def __init__(self, **given) -> None:
        self.limit = ConcurrencyLimit("questions", wait_s=60, in_turns=True, **given)
        self.going_on: list[tuple[str, asyncio.Event]] = []
        self.order: list[str] = []
        self.came = asyncio.Event()

    async def ask(self, who: str) -> None:
        async with self.limit.slot(who):
            done = asyncio.Event()
            self.order.append(who)
            self.going_on.append((who, done))
            self.came.set()
            await done.wait()

    async def until(self, number: int) -> None:
        while len(self.order) < number:
            self.came.clear()
            await self.came.wait()

    def end_one(self, who: str | None = None) -> None:
        index = next(n for n, (of, _) in enumerate(self.going_on) if who in {None, of})
        self.going_on.pop(index)[1].set()


def test_many_keys_have_the_lane_in_turns() -> None:
    async def play() -> None:
        lane = Lane(per_caller=1, total=2)
        async with asyncio.TaskGroup() as group:
            # Every key of one owner is a caller of its own; together they have two places.
            for who in [*["a"] * 5, *["b"] * 5, "c", "d"]:
                group.create_task(lane.ask(who))
            await lane.until(2)
            assert Counter(lane.order) == {"a": 1, "b": 1}
            for number in range(3, 13):
                lane.end_one()
                await lane.until(number)
                going = [who for who, _ in lane.going_on]
                assert len(going) == len(set(going)) <= 2
            # Nobody had a second turn before all had a first, as far as places allow.
            assert set(lane.order[:5]) == {"a", "b", "c", "d"}
            while lane.going_on:
                lane.end_one()
        assert not lane.limit._shares
        assert lane.limit._used == 0

    asyncio.run(play())


def test_whoever_leaves_while_waiting_keeps_no_place() -> None:
    async def play() -> None:
        lane = Lane(per_caller=1, total=1)
        first = asyncio.create_task(lane.ask("a"))
        await lane.until(1)
        leaving = [asyncio.create_task(lane.ask(who)) for who in ("a", "b", "c")]
        await asyncio.sleep(0)
        staying = asyncio.create_task(lane.ask("d"))
        await asyncio.sleep(0)
        for task in leaving:
            task.cancel()
        lane.end_one()
        await asyncio.gather(*leaving, return_exceptions=True)
        await lane.until(2)
        assert lane.order == ["a", "d"]
        lane.end_one()
        await asyncio.gather(first, staying)
        assert not lane.limit._shares
        assert lane.limit._used == 0

    asyncio.run(play())


def test_one_too_many_is_refused_and_told_its_weight() -> None:
    async def play() -> None:
        lane = Lane(per_caller=1, total=1)
        waiting = [asyncio.create_task(lane.ask("a")) for _ in range(1 + MAX_WAITING)]
        await lane.until(1)
        with pytest.raises(ProblemError, match="this one weighs 7") as raised:
            async with asyncio.timeout(5), lane.limit.slot("a", weight=7):
                pass
        assert raised.value.headers == {"Retry-After": "2"}
        for task in waiting:
            task.cancel()

    asyncio.run(play())


INVENTED = {"track": 422, "task": 422, "category": 422, "model": 200, "sweep": 404}


@pytest.mark.usefixtures("board")
def test_invented_names_fill_no_cache_and_cost_few_statements(api, context) -> None:
    cache = api.app.state.boards._answers
    first = api.get("/v1/leaderboard")
    pair = {"first": "builtin/idle", "second": "builtin/idle"}
    with statements_of(context.store.database.engine) as statements:
        for (name, status), kind in product(INVENTED.items(), ("", "/figures", "/compare")):
            names, costs = pair if kind == "/compare" else {}, []
            wanted = 422 if (name, kind) == ("model", "/compare") else status
            for number in range(3):
                statements.clear()
                params = {**names, name: f"invented-{number}"}
                answer = api.get(f"/v1/leaderboard{kind}", params=params)
                assert answer.status_code == wanted, (name, kind)
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
    # All invented models are one question of a board and one of its figures.
    assert len(cache) <= 3
    again = api.get("/v1/leaderboard", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304
