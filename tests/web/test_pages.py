"""The dashboard in a real browser, against the whole service."""

import httpx
import pytest
from pydantic import SecretStr
from support.documents.pages import LOOKS, in_browser, needs_pages
from support.servers.reverse_proxy import ProxyRules, reverse_proxy
from support.servers.stacks import finished, running_stack

SWEEP = {
    "name": "pages",
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/idle"],
    "seeds": [0],
    "simulator": "mujoco",
}
ADMIN = "operator-secret-that-is-long-enough"

pytestmark = needs_pages


@pytest.mark.ci
@pytest.mark.parametrize("files", ["e2e/pages", "e2e/boards"])
@pytest.mark.parametrize("looks", LOOKS)
def test_pages_work_in_a_browser(tmp_path, files, looks) -> None:
    with running_stack(tmp_path) as stack:
        with httpx.Client(base_url=stack.url) as client:
            sweep_id = client.post("/v1/sweeps", json=SWEEP).raise_for_status().json()["id"]
            finished(client, sweep_id)
        in_browser(stack.url, [files], **looks)


@pytest.mark.nightly
def test_people_build_and_strangers_do_nothing(tmp_path) -> None:
    with running_stack(tmp_path, simulators=("pybullet", "mujoco")) as stack:
        in_browser(
            stack.url,
            ["e2e/build", "e2e/program", "e2e/strangers", "e2e/robust", "e2e/toy"],
        )


@pytest.mark.ci
def test_pages_ask_for_a_key_and_offer_what_it_may(tmp_path) -> None:
    with running_stack(tmp_path, require_keys=True, admin_key=SecretStr(ADMIN)) as stack:
        given = {"BUILDARENA_WEB_GUARDED_URL": stack.url, "BUILDARENA_WEB_ADMIN_KEY": ADMIN}
        in_browser(stack.url, ["e2e/keys"], **given)


@pytest.mark.nightly
def test_pages_work_below_a_path(tmp_path) -> None:
    with (
        running_stack(tmp_path, base_path="/tools/arena") as stack,
        httpx.Client(base_url=stack.url) as client,
        reverse_proxy(stack.url, ProxyRules(prefix="/tools/arena")) as outer,
    ):
        client.post("/v1/sweeps", json=SWEEP).raise_for_status()
        in_browser(outer, ["e2e/below"], BUILDARENA_WEB_ROOT_URL=stack.url)
