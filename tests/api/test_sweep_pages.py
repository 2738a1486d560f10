"""What pages about sweeps are made of: who asks, what went wrong, what changed, two in pairs."""

import pytest
from support.clients.tenants import new_tenant, operator
from support.jobs import claim, execute, finish

from buildarena_store.states import AttemptResult, JobState


def submitted(api, **changes: object) -> str:
    spec = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1], **changes}
    answer = api.post("/v1/sweeps", json=spec)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def score(context, outcomes: dict[tuple[str, int], bool], simulator: str = "") -> None:
    """Ends waiting jobs as told by model and seed."""
    left = []
    while (lease := context.store.leases.claim("construct", owner="w")) is not None:
        won = outcomes.get((lease.job.model, lease.job.seed))
        if won is None or simulator not in lease.job.track:
            left.append(lease)
        elif won:
            finish(context, lease, "success", 5.0)
        else:
            finish(context, lease, "unsuccessful", 1.0)
    for lease in left:
        with context.store.database.transaction() as connection:
            context.store.leases.advance(lease, to=JobState.QUEUED, connection=connection)


def test_who_asks_without_keys_is_admin(api) -> None:
    answer = api.get("/v1/caller")
    assert answer.json() == {"key": None, "scope": "admin", "keys_required": False}
    assert answer.headers["cache-control"] == "no-store"


def test_who_asks_with_keys_is_told_their_scope(guarded) -> None:
    assert guarded.get("/v1/caller").status_code == 401
    reader = new_tenant(guarded, "ada", "read")
    builder = new_tenant(guarded, "bob", "read", "submit")
    for who, scope in ((reader, "read"), (builder, "submit"), (operator(guarded), "admin")):
        told = {"key": who.id, "scope": scope, "keys_required": True}
        assert who.get("/v1/caller") == told


def test_troubles_are_counted_by_what_they_are(api, context) -> None:
    sweep, other = submitted(api), submitted(api, seeds=[7])
    assert api.get(f"/v1/sweeps/{sweep}/troubles").json() == []
    for number in range(5):
        lease = claim(context, f"w{number}")
        with context.store.database.transaction() as connection:
            context.store.leases.advance(
                lease,
                to=JobState.QUEUED,
                connection=connection,
                result=AttemptResult.LOST if number == 4 else AttemptResult.FAULT,
                note=None if number == 4 else "provider answered 503",
            )
    found = [
        trouble
        for id_ in (sweep, other)
        for trouble in api.get(f"/v1/sweeps/{id_}/troubles").json()
    ]
    assert sum(one["attempts"] for one in found) == 5
    assert {(one["result"], one["detail"]) for one in found} == {
        ("fault", "provider answered 503"),
        ("lost", None),
    }
    assert all(one["jobs"] <= one["attempts"] and one["model"] == "builtin/idle" for one in found)
    assert api.get("/v1/sweeps/sweep_0/troubles").status_code == 404


def test_whoever_has_read_the_jobs_hears_only_what_happened_since(api, context) -> None:
    sweep = submitted(api)
    assert api.get(f"/v1/sweeps/{sweep}").json()["last_event"] == 0
    events = context.store.events.after(0, sweep_id=sweep)
    execute(context, "UPDATE events SET at = at - interval '6 seconds'")
    seen = api.get(f"/v1/sweeps/{sweep}").json()["last_event"]
    assert seen == events[-1].id
    assert api.get("/v1/sweeps").json()["sweeps"][0]["last_event"] == seen
    score(context, {("builtin/idle", 0): True})
    assert api.get(f"/v1/sweeps/{sweep}").json()["last_event"] == seen
    since = context.store.events.after(seen, sweep_id=sweep)
    assert "done" in {event.kind for event in since}


@pytest.fixture
def two_sweeps(api, context) -> tuple[str, str]:
    seeds = list(range(4))
    both = ["builtin/idle", "builtin/random"]
    first = submitted(api, models=both, seeds=seeds, simulator="mujoco", name="one")
    second = submitted(api, models=both[:1], seeds=seeds, simulator="pybullet", name="two")
    good = {(model, seed): seed < 3 for model in both for seed in seeds}
    score(context, good, "mujoco")
    score(context, {("builtin/idle", 0): False, ("builtin/idle", 1): True}, "pybullet")
    return first, second


def test_two_sweeps_are_compared_in_pairs(api, two_sweeps) -> None:
    first, second = two_sweeps
    found = api.get(f"/v1/sweeps/{first}/compare/{second}").json()
    assert [found[side]["name"] for side in ("first", "second")] == ["one", "two"]
    assert [found[side]["ended"] for side in ("first", "second")] == [8, 2]
    [pair] = found["pairs"]
    [task] = pair["tasks"]
    assert (pair["first"], task["task"]) == ("builtin/idle", "support-1")
    assert (task["successes"], task["trials"]) == ([3, 1], [4, 2])
    assert task["success"]["pairs"] == 2
    [differing] = pair["differing"]
    sides = [differing[side]["success"] for side in ("first", "second")]
    assert (differing["seed"], sides) == (0, [True, False])
    (left,) = found["left_out"]
    assert (left["kind"], left["name"]) == ("model", "builtin/random")


def test_a_sweep_against_itself_differs_in_nothing(api, two_sweeps) -> None:
    first, _ = two_sweeps
    found = api.get(f"/v1/sweeps/{first}/compare/{first}").json()
    assert [pair["first"] for pair in found["pairs"]] == ["builtin/idle", "builtin/random"]
    for pair in found["pairs"]:
        assert pair["differing"] == []
        assert all(task["difference"] == 0 for task in pair["tasks"])


def test_the_only_models_of_two_sweeps_are_a_pair(api, context) -> None:
    first, second = submitted(api), submitted(api, models=["builtin/random"])
    score(context, {("builtin/idle", 0): True, ("builtin/random", 0): False})
    found = api.get(f"/v1/sweeps/{first}/compare/{second}").json()
    [pair] = found["pairs"]
    assert (pair["first"], pair["second"]) == ("builtin/idle", "builtin/random")
    assert [one["seed"] for one in pair["differing"]] == [0]


def test_sweeps_that_have_nothing_in_common_say_so(api, context) -> None:
    first, second = submitted(api), submitted(api, tasks=["lift-1"])
    score(context, {("builtin/idle", 0): True})
    found = api.get(f"/v1/sweeps/{first}/compare/{second}").json()
    assert found["pairs"] == []
    assert {one["name"] for one in found["left_out"]} == {"support-1", "lift-1"}
    empty = submitted(api, seeds=[99])
    assert api.get(f"/v1/sweeps/{empty}/compare/{empty}").json()["pairs"] == []


def test_an_unknown_sweep_is_refused_on_both_sides(api) -> None:
    sweep = submitted(api)
    for one, other in ((sweep, "sweep_none"), ("sweep_none", sweep)):
        answer = api.get(f"/v1/sweeps/{one}/compare/{other}")
        assert answer.status_code == 404
        assert "sweep_none" in answer.json()["detail"]
