"""The runner protocol's part of the contract under generated requests of one who may."""

from dataclasses import replace
from typing import Any

import pytest
from schemathesis import GenerationMode
from support.clients.tenants import WITH_KEYS
from support.servers.contract import SCHEMA, ask, ways
from support.servers.live_api import live_api
from support.servers.runner_rig import Caller, waiting


@pytest.mark.ci
def test_every_answer_is_a_documented_one(context) -> None:
    own = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False, "lease_s": 60.0})
    with live_api(replace(context, settings=own)) as url:
        for number, way in enumerate(ways(SCHEMA.include(path_regex="^/v1/runner"))):
            waiting(context, seed=number)
            lease = Caller(url, name=f"slot-{number}").lease()
            ask_oddly(url, way, lease)


def ask_oddly(url: str, way: tuple[Any, GenerationMode], lease: dict[str, object]) -> None:
    def prepare(case: Any) -> None:
        # Half of what is worth asking needs a lease that lives.
        for name in ("job_id", "token"):
            if way[1] is GenerationMode.POSITIVE and name in (case.path_parameters or {}):
                case.path_parameters[name] = lease[name]
        if isinstance(case.body, dict) and "wait_s" in case.body:
            case.body["wait_s"] = 0

    ask(url, way, 4, prepare)
