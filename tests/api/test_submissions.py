"""Packages at the API: handed in, checked once, seen by whom they concern, ranked, decided on."""

import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from threading import Thread

import pytest
from starlette.testclient import TestClient
from support.challenge import CENTER, packed
from support.clients.tenants import WITH_KEYS, new_tenant, operator

from buildarena_api import package_checks
from buildarena_api.app import create_app
from buildarena_api.package_checks import PackageChecks
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.challenges.season import season_named
from buildarena_store.artifacts import GarbageCollector

PATH = "/v1/submissions"
KNOWN = season_named("s01-stable-orbit").with_parameters({"center": list(CENTER), "omega_ref": 0.3})
SEASONS = {KNOWN.name: KNOWN}


def as_entry(name: str = "mine", track: str = "autopilot") -> dict[str, str]:
    return {"season": KNOWN.name, "track": track, "name": name}


@pytest.fixture
def checks(context):
    checks = PackageChecks(context, SEASONS)
    yield checks
    checks.close()


@pytest.fixture
def people(context, monkeypatch):
    """The API, whose own checks wait for longer than a test, and two who hand in."""
    monkeypatch.setattr(package_checks, "PERIOD_S", 3600.0)
    with _service(context) as client:
        client.app.state.seasons = SEASONS
        yield client, new_tenant(client, "ann", "submit"), new_tenant(client, "bob", "submit")


def _service(context) -> TestClient:
    settings = context.settings.model_copy(update=WITH_KEYS)
    return TestClient(create_app(replace(context, settings=settings), load_registry()))


@pytest.mark.nightly
def test_the_service_checks_what_comes_by_itself(context) -> None:
    with _service(context) as client:
        ann = new_tenant(client, "ann", "submit")
        made = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()
        until = time.monotonic() + 60.0
        while (shown := ann.get(f"{PATH}/{made['id']}"))["state"] != "scored":
            assert time.monotonic() < until, shown
            time.sleep(0.1)
        assert shown["report"]["score"]["unknown"][0] == "omega_ref"


@pytest.mark.nightly
def test_a_package_is_taken_in_checked_and_ranked(people, checks) -> None:
    _, ann, bob = people
    first = ann.ask("POST", PATH, params=as_entry(), content=packed())
    again = ann.ask("POST", PATH, params=as_entry(), content=packed())
    assert (first.status_code, again.status_code) == (201, 200), first.text
    assert (first.json()["state"], first.json()["added"], again.json()["added"]) == (
        "received",
        True,
        False,
    )
    assert first.headers["Location"] == f"{PATH}/{first.json()['id']}"
    assert bob.ask("POST", PATH, params=as_entry("his"), content=packed("five_blocks")).is_success
    assert checks.check_waiting() == 2
    shown = ann.get(first.headers["Location"])
    assert shown["state"] == "scored"
    assert shown["report"]["passed"]
    assert shown["points"] == pytest.approx(shown["report"]["score"]["known"])
    board = bob.get(f"/v1/seasons/{KNOWN.name}/board?track=autopilot")
    assert [(row["rank"], row["package"]["name"]) for row in board] == [(1, "mine"), (1, "his")]
    assert checks.check_waiting() == 0


@pytest.mark.nightly
def test_a_look_at_a_package_keeps_nothing(people) -> None:
    _, ann, _ = people
    asked = {"season": KNOWN.name, "track": "autopilot"}
    found = ann.ask("POST", f"{PATH}/check", params=asked, content=packed()).json()
    assert found["passed"]
    assert found["points"] > 70
    found = ann.ask("POST", f"{PATH}/check", params=asked, content=b"PK").json()
    assert "no sound ZIP file" in found["reason"]
    assert ann.get(PATH) == []


@pytest.mark.nightly
def test_a_newer_package_of_the_same_name_replaces_the_older(people, checks) -> None:
    _, ann, _ = people
    ids = []
    for note in ("", "once more"):
        ids.append(ann.ask("POST", PATH, params=as_entry(), content=packed(note=note)).json()["id"])
        checks.check_waiting()
    board = ann.get(f"/v1/seasons/{KNOWN.name}/board?track=autopilot")
    assert [row["package"]["id"] for row in board] == ids[1:]
    assert ann.ask("POST", f"{PATH}/{ids[1]}/withdraw").json()["state"] == "withdrawn"
    board = ann.get(f"/v1/seasons/{KNOWN.name}/board?track=autopilot")
    assert [row["package"]["id"] for row in board] == ids[:1]


@pytest.mark.nightly
def test_nobody_learns_from_another_before_the_season_is_closed(people, checks) -> None:
    client, ann, bob = people
    made = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()
    checks.check_waiting()
    place = f"{PATH}/{made['id']}"
    for path in (place, f"{place}/file"):
        assert bob.ask("GET", path).status_code == 403
        assert client.get(path).status_code == 401
        assert operator(client).ask("GET", path).status_code == 200
    assert bob.ask("POST", f"{place}/withdraw").status_code == 403
    assert ann.ask("GET", f"{place}/file").content == packed()
    listed = bob.get(PATH)
    assert [set(row) & {"report", "hash", "owner", "reason", "copies"} for row in listed] == [set()]
    assert bob.get(f"{PATH}?own=true") == []
    client.app.state.seasons = {
        KNOWN.name: KNOWN.model_copy(update={"closes": datetime.now(UTC) - timedelta(hours=1)})
    }
    assert bob.ask("GET", f"{place}/file").status_code == 200
    assert ann.ask("POST", PATH, params=as_entry("late"), content=b"").status_code == 409


@pytest.mark.nightly
def test_what_breaks_a_rule_is_refused_with_its_sentence(people, checks) -> None:
    _, ann, _ = people
    for content, words in ((b"PK", "no sound ZIP file"), (packed()[:-40], "no sound ZIP file")):
        made = ann.ask("POST", PATH, params=as_entry(), content=content)
        assert made.status_code == 201
        checks.check_waiting()
        shown = ann.get(made.headers["Location"])
        assert shown["state"] == "refused"
        assert words in shown["reason"]
        assert shown["points"] is None
    assert ann.get(f"/v1/seasons/{KNOWN.name}/board?track=autopilot") == []


@pytest.mark.nightly
def test_organisers_decide_with_reasons_that_stay(people, checks) -> None:
    client, ann, bob = people
    mine = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()["id"]
    copy = bob.ask("POST", PATH, params=as_entry(), content=packed(note="all mine")).json()["id"]
    refusal = {"state": "refused", "reason": "a copy of another entry"}
    early = operator(client).ask("POST", f"{PATH}/{copy}/decision", json=refusal)
    assert early.status_code == 409
    checks.check_waiting()
    assert operator(client).get(f"{PATH}/{copy}")["copies"] == [mine]
    assert bob.get(f"{PATH}/{copy}")["copies"] == []
    assert bob.ask("POST", f"{PATH}/{mine}/decision", json=refusal).status_code == 403
    empty = {**refusal, "reason": ""}
    assert operator(client).ask("POST", f"{PATH}/{copy}/decision", json=empty).status_code == 422
    for _ in range(2):  # the same again is no further change
        done = operator(client).ask("POST", f"{PATH}/{copy}/decision", json=refusal).json()
    assert done["state"] == "refused"
    accepted = {"state": "accepted", "reason": "it was the first, after all"}
    done = operator(client).ask("POST", f"{PATH}/{copy}/decision", json=accepted).json()
    changes = [(each["state_before"], each["state"], each["reason"]) for each in done["changes"]]
    assert changes == [
        ("scored", "refused", refusal["reason"]),
        ("refused", "accepted", accepted["reason"]),
    ]


@pytest.mark.nightly
def test_other_rules_have_packages_checked_again_but_words_of_people_stay(people, context) -> None:
    client, ann, _ = people
    mine = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()["id"]
    other = ann.ask("POST", PATH, params=as_entry("b"), content=packed("five_blocks")).json()["id"]
    before = PackageChecks(context, SEASONS)
    assert before.check_waiting() == 2
    decided = {"state": "refused", "reason": "no"}
    operator(client).ask("POST", f"{PATH}/{other}/decision", json=decided)
    points = ann.get(f"{PATH}/{mine}")["points"]
    before.close()
    stricter = {KNOWN.name: KNOWN.with_parameters({"cycles": 6})}
    after = PackageChecks(context, stricter)
    assert after.check_waiting() == 1
    assert ann.get(f"{PATH}/{mine}")["points"] < points
    assert ann.get(f"{PATH}/{other}")["reason"] == "no"
    after.close()


@pytest.mark.nightly
def test_a_season_takes_so_many_a_day_of_one_owner(people) -> None:
    client, ann, bob = people
    client.app.state.seasons = {KNOWN.name: KNOWN.model_copy(update={"attempts_a_day": 2})}
    codes = [
        ann.ask("POST", PATH, params=as_entry(), content=f"{n}".encode()).status_code
        for n in (1, 2, 2, 3, 4)
    ]
    assert codes == [201, 201, 200, 429, 429]
    assert bob.ask("POST", PATH, params=as_entry(), content=b"1").status_code == 201


@pytest.mark.nightly
def test_packages_are_checked_once_by_many_and_none_is_lost(people, context) -> None:
    """Four checkers at once; the package of one that was killed meanwhile is not lost."""
    _, ann, bob = people
    for n in range(10):
        who = (ann, bob)[n % 2]
        assert who.ask("POST", PATH, params=as_entry(str(n)), content=f"{n}".encode()).is_success
    killed = context.store.packages.claim()
    several = [PackageChecks(context, SEASONS) for _ in range(4)]
    counts: list[int] = []
    threads = [
        Thread(target=lambda each=each: counts.append(each.check_waiting())) for each in several
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(counts) == 9
    with context.store.database.transaction() as connection:
        connection.exec_driver_sql(
            "UPDATE packages SET claimed_at = claimed_at - interval '1 hour'"
        )
    assert several[0].check_waiting() == 1
    shown = context.store.packages.show(killed.id)
    assert shown.state == "refused"
    for each in several:
        each.close()


def test_unknown_seasons_tracks_and_names_are_told_with_choices(people) -> None:
    _, ann, _ = people
    wrong = {**as_entry(), "season": "s02"}
    refused = ann.ask("POST", PATH, params=wrong, content=b"")
    assert refused.status_code == 404
    assert "s01-stable-orbit" in refused.json()["detail"]
    refused = ann.ask("POST", PATH, params=as_entry(track="robots"), content=b"")
    assert "there is autopilot, copilot, human" in refused.json()["detail"]
    for name in ("", "x" * 81, "a\nb"):
        assert ann.ask("POST", PATH, params=as_entry(name), content=b"").status_code == 422
    assert ann.ask("GET", f"{PATH}/package_{'0' * 20}").status_code == 404
    assert ann.ask("GET", f"/v1/seasons/{KNOWN.name}/board?track=x").status_code == 404
    seasons = ann.get("/v1/seasons")
    assert [each["season"]["name"] for each in seasons] == [KNOWN.name]
    assert seasons[0]["is_open"]


def test_too_large_a_package_is_refused_while_it_comes(people, monkeypatch) -> None:
    _, ann, _ = people
    monkeypatch.setattr("buildarena_api.routes.challenges.MAX_BYTES", 1000)
    assert ann.ask("POST", PATH, params=as_entry(), content=packed()).status_code == 413


@pytest.mark.nightly
def test_packages_are_no_garbage(people, context) -> None:
    _, ann, _ = people
    made = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()
    done = GarbageCollector(context.store.database, context.artifacts).collect()
    assert done is not None
    assert done.kept == 1
    assert context.artifacts.get(made["hash"]) == packed()


@pytest.mark.nightly
def test_what_passed_is_shown_to_whom_it_concerns(people, checks) -> None:
    client, ann, bob = people
    made = ann.ask("POST", PATH, params=as_entry(), content=packed()).json()
    place = f"{PATH}/{made['id']}/picture"
    early = ann.ask("GET", place)
    assert early.status_code == 409
    assert "only what passed is shown" in early.json()["detail"]
    checks.check_waiting()
    picture = ann.get(place)
    (machine,) = picture["machines"].values()
    assert [block["module"] for block in machine["blocks"]] == [
        *("Starting Block", "Steering Thruster", "Steering Thruster")
    ]
    flight = picture["flight"]
    assert len(flight["time_s"]) == len(flight["places"]) > 100
    x, y, z = CENTER
    assert flight["center"] == [x, z, y]  # in the game y points up
    away = [sum((a - b) ** 2 for a, b in zip(p, flight["center"], strict=True)) ** 0.5
            for p in flight["places"]]  # fmt: skip
    assert min(away) > 100
    assert bob.ask("GET", place).status_code == 403
    assert operator(client).get(place) == picture


@pytest.mark.nightly
def test_admins_see_who_decided_what_in_a_season(people, checks) -> None:
    client, ann, _ = people
    ids = [
        ann.ask("POST", PATH, params=as_entry(name), content=packed(note=name)).json()["id"]
        for name in ("one", "two")
    ]
    checks.check_waiting()
    boss = operator(client)
    decided = {"state": "refused", "reason": "flown by a program"}
    assert boss.ask("POST", f"{PATH}/{ids[0]}/decision", json=decided).status_code == 200
    assert ann.ask("POST", f"{PATH}/{ids[1]}/withdraw").status_code == 200
    changes = boss.get(f"/v1/seasons/{KNOWN.name}/changes")
    seen = [(c["package"], c["name"], c["state"], c["reason"]) for c in changes[:2]]
    assert seen == [
        (ids[1], "two", "withdrawn", "withdrawn by its owner"),
        (ids[0], "one", "refused", "flown by a program"),
    ]
    assert ann.ask("GET", f"/v1/seasons/{KNOWN.name}/changes").status_code == 403
    assert boss.ask("GET", "/v1/seasons/none/changes").status_code == 404
