"""What pages about sweeps are made of: who asks, what went wrong, what changed, two in pairs."""

from support.clients.tenants import new_tenant, operator
from support.jobs import claim, execute, finish

from buildarena_store.states import AttemptResult, JobState


def submitted(api, **changes: object) -> str:
    spec = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1], **changes}
    answer = api.post("/v1/sweeps", json=spec)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def score(context, outcomes: dict[tuple[str, int], bool]) -> None:
    """Ends waiting jobs as told by model and seed."""
    left = []
    while (lease := context.store.leases.claim("construct", owner="w")) is not None:
        won = outcomes.get((lease.job.model, lease.job.seed))
        if won is None:
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
