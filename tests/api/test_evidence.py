"""Evidence of the game at the API: who may send it, that it is judged there, and once only."""

from dataclasses import replace

import pytest
from starlette.testclient import TestClient
from support.clients.tenants import WITH_KEYS, new_tenant, operator
from support.evenings import packed, repacked

from buildarena_api.app import create_app
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.evidence.archive_names import DOCUMENT
from buildarena_store.artifacts import GarbageCollector

PATH = "/v1/besiege/evidence"


def boasting() -> bytes:
    """A log is damaged, and its sender's verdicts are as before."""

    def damage(members: dict[str, bytes]) -> None:
        members["steps/probe/log-1.txt"] = b"nothing"

    return repacked(packed("probe"), damage)


@pytest.mark.nightly
def test_what_is_sent_is_judged_stored_once_and_shown(api) -> None:
    data = packed("doctor", "probe", "expert-support-1")
    first, again = (api.post(PATH, content=data) for _ in range(2))
    assert (first.status_code, again.status_code) == (201, 200), first.text
    added = first.json()
    assert (added["added"], again.json()["added"]) == (True, False)
    assert {**added, "added": False} == again.json()
    listed = api.get(PATH).json()
    assert [row["id"] for row in listed] == [added["id"]]
    assert listed[0]["verdicts"]["confirmed"] == 8
    assert listed[0]["differing"] == 0
    shown = api.get(f"{PATH}/{added['id'][:8]}").json()
    rows = {(row["step"], row["assumption"]): row["verdict"] for row in shown["table"]["rows"]}
    assert rows["probe", "mass_slider"] == "not_seen"
    assert shown["table"]["agreement"][0]["same_verdict"] == 1
    assert first.headers["Location"] == f"{PATH}/{added['id']}"
    assert api.get(f"{PATH}/{added['id']}/file").content == data


@pytest.mark.nightly
def test_verdicts_that_logs_do_not_bear_out_are_marked(api) -> None:
    done = api.post(PATH, content=boasting()).json()
    assert done["differing"] == 4
    assert done["verdicts"]["confirmed"] == 1  # the pace is the runner's own clock's
    row = next(row for row in done["table"]["rows"] if row["assumption"] == "gravity")
    assert (row["verdict"], row["stated"]) == ("not_seen", "confirmed")


@pytest.mark.nightly
@pytest.mark.parametrize(
    "data",
    [b"", b"PK", repacked(packed("doctor"), lambda m: m.pop(DOCUMENT))],
    ids=["empty", "two bytes", "no document"],  # of the package, whose bytes have the time in them
)
def test_what_is_no_evidence_is_refused_and_leaves_nothing(api, data) -> None:
    refused = api.post(PATH, content=data)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["field"] == "file"
    assert api.get(PATH).json() == []


def test_too_large_a_file_is_refused_while_it_comes(api, monkeypatch) -> None:
    monkeypatch.setattr("buildarena_api.routes.evidence.MAX_BYTES", 1000)
    assert api.post(PATH, content=packed("doctor")).status_code == 413


@pytest.mark.nightly
def test_admins_send_and_every_key_reads(context) -> None:
    settings = context.settings.model_copy(update=WITH_KEYS)
    with TestClient(create_app(replace(context, settings=settings), load_registry())) as client:
        data = packed("doctor")
        person = new_tenant(client, "person", "submit")
        refused = person.ask("POST", PATH, content=data)
        assert refused.status_code == 403
        assert operator(client).ask("POST", PATH, content=data).status_code == 201
        assert len(person.get(PATH)) == 1
        assert client.post(PATH, content=data).status_code == 401


def test_unknown_evidence_is_not_found(api) -> None:
    missing = api.get(f"{PATH}/{'0' * 12}")
    assert missing.status_code == 404
    assert PATH in missing.json()["detail"]
    assert api.get(f"{PATH}/..%2Fx").status_code in {404, 422}


def test_evidence_is_no_garbage(api, context) -> None:
    added = api.post(PATH, content=packed("doctor")).json()
    done = GarbageCollector(context.store.database, context.artifacts).collect()
    assert done is not None
    assert done.kept == 1
    assert context.artifacts.get(added["id"])
