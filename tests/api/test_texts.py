"""Whatever a text of a request holds, the service stores and answers it, or refuses it in words."""

import copy
import json
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from support.machines.building import BLOCK, built
from support.marks import nightly

from buildarena_api.routes.tasks import EXAMPLE

NASTY = ("\0", "\ud800", "a\u202eb", "a\u200bb", "\ufeff", "é🚗", "x" * 5000, "%00'; --", "")
JSON = {"Content-Type": "application/json"}
YAML = {"Content-Type": "application/yaml"}
SWEEP = {"name": "mine", "tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0]}
SWEEP |= {"workflow": "five-role", "prompts": "default", "simulator": "mujoco"}
SESSION = {"task": "support-1", "agent": "me", "kind": "agent", "simulator": "mujoco"}
CALL = {"tool": "start", "arguments": {"note": "x", "deep": [{"a": "b"}]}, "machine": "main"}
KEY = {"name": "ada", "scopes": ["read"]}
RUNNER = {"name": "lab", "simulators": {"mujoco": "9"}, "versions": {"os": "x", "more": ["y"]}}
MACHINE = built(("1", "E", BLOCK)).with_controller("function act() end").to_document()


def variants(document: Any, every: int) -> Iterator[Any]:
    """The document with each of its texts, keys included, in turn replaced by nasty ones.

    A place gets every third of them, say, and the next place those beside these.
    """

    def places(part: Any, path: tuple) -> Iterator[tuple]:
        if isinstance(part, str):
            yield path
        for key, inside in part.items() if isinstance(part, dict) else ():
            yield (*path, key)
            yield from places(inside, (*path, key))
        for index, inside in enumerate(part) if isinstance(part, list) else ():
            yield from places(inside, (*path, index))

    for number, path in enumerate(dict.fromkeys(places(document, ()))):
        for text in NASTY[number % every :: every]:
            changed = copy.deepcopy(document)
            around = changed
            for step in path[:-1]:
                around = around[step]
            if isinstance(around[path[-1]], str):
                around[path[-1]] = text
            else:
                around[text] = around.pop(path[-1])
            yield changed


@pytest.mark.parametrize("every", [3, nightly(1)])
def test_no_text_of_any_document_is_more_than_the_service_can_take(api, subtests, every) -> None:
    session = api.post("/v1/sessions", json=SESSION).json()["id"]
    task = yaml.safe_load(EXAMPLE)
    for path, document, headers in (
        ("/v1/jobs", {"task": "support-1", "model": "builtin/idle"}, JSON),
        ("/v1/sweeps", SWEEP, JSON),
        ("/v1/sweeps", SWEEP, YAML),
        ("/v1/sweeps/estimate", SWEEP, JSON),
        ("/v1/sessions", SESSION, JSON),
        (f"/v1/sessions/{session}/calls", CALL, JSON),
        ("/v1/keys", KEY, JSON),
        ("/v1/tasks", task, YAML),
        ("/v1/tasks", task, JSON),
        ("/v1/leaderboard/verify", {"model": "builtin/idle", "tasks": ["support-1"]}, JSON),
        ("/v1/runner/heartbeat", RUNNER, JSON),
        ("/v1/runner/leases", RUNNER, JSON),
        ("/v1/machines/check", MACHINE, {}),
        ("/v1/machines/trials?task=support-1&simulator=mujoco", MACHINE, {}),
    ):
        with subtests.test(path=path, headers=headers):
            for changed in variants(document, every):
                body = json.dumps(changed).encode()  # which is YAML too
                answer = api.post(path, content=body, headers=headers)
                assert answer.status_code < 500, (body[:300], answer.text)
    for path in ("/v1/jobs", "/v1/sweeps", "/v1/tasks", "/v1/keys", "/v1/workers"):
        assert api.get(path).status_code == 200
    for name in ("task", "model", "text", "cursor", "sweep", "flag", "id_prefix"):
        for text in NASTY:
            query = {name: text.encode("utf-8", "replace")}
            assert api.get("/v1/jobs", params=query).status_code < 500, (name, text)


def test_names_of_invisible_characters_are_refused(api) -> None:
    for text in ("a\u202eb", "a\u200bb", "\u2066x", "a\x85"):
        answer = api.post("/v1/sweeps", json={**SWEEP, "name": text})
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "name")
        assert api.post("/v1/keys", json={**KEY, "name": text}).status_code == 422
    kept = api.post("/v1/sweeps", json={**SWEEP, "name": "Brücke 🚗"}).json()["id"]
    assert api.get(f"/v1/sweeps/{kept}").json()["name"] == "Brücke 🚗"


def test_numbers_are_numbers(api) -> None:
    for bad in (True, "5", 5.5):
        for part in ("budget", "limits"):
            body = {**SWEEP, part: {"max_requests": bad}}
            answer = api.post("/v1/sweeps/estimate", json=body)
            assert answer.status_code == 422, (part, bad)
