"""Whole sessions over every protocol, held to the alternation that strict chat templates demand."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from support.providers.stand_in import ProviderStandIn

from buildarena_worker.builtin.expert import reply as expert
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.workflow.rounds import Loop

pytestmark = pytest.mark.ci

PROTOCOLS = ["openai", "anthropic", "google"]


def speakers(protocol: str, body: dict[str, Any]) -> list[str]:
    """Who speaks, message by message, as the protocol carries it."""
    if protocol == "google":
        kinds = {"model": "assistant", "user": "user"}
        return [
            "tool" if "functionResponse" in content["parts"][0] else kinds[content["role"]]
            for content in body["contents"]
        ]
    return [m["role"] for m in body["messages"] if m["role"] != "system"]


def is_strict(roles: list[str]) -> bool:
    """Whether nobody speaks twice in a row; a tool's result stands between a call and the next."""
    pairs = set(itertools.pairwise(roles))
    return (
        roles[0] == "user"
        and roles[-1] in {"user", "tool"}
        and not pairs & {("user", "user"), ("assistant", "assistant")}
    )


def awkward(request: Request) -> Completion:
    """The expert, but its first plan and its first program can't be read."""
    own = [m for m in request.messages if m.role == "assistant"]
    role = request.messages[0].text.splitlines()[0]
    if role in {"# Role: planner", "# Role: controller"} and not own:
        return Completion(text="Let me think aloud first.")
    return expert(request)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_driven_session_alternates_through_three_attempts(
    play, rollout, protocol, client
) -> None:
    records = [rollout(n, success=False, indicator=float(n)) for n in range(2)]
    with ProviderStandIn(respond=awkward) as standin:
        played = play(task="transport-1", client=client(standin, protocol), rollouts=records)
    assert played.suspended is not None, played.failure
    assert played.suspended.number == 2
    controls = [turn for turn in played.session.transcript.turns if turn.stage == "control"]
    assert len(controls) == 4
    for body in standin.counts.bodies:
        assert is_strict(speakers(protocol, body)), speakers(protocol, body)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_closed_loop_with_an_analyst_alternates(play, rollout, protocol, client) -> None:
    with ProviderStandIn(respond=awkward) as standin:
        played = play(
            task="lift-3",
            client=client(standin, protocol),
            loop=Loop(rounds=2, analyst=True),
            rollouts=[rollout(0, success=False, indicator=3.0)],
        )
    assert played.suspended is not None, played.failure
    assert (played.suspended.number, played.suspended.final) == (1, True)
    assert {turn.stage for turn in played.session.transcript.turns} >= {"analyse", "assemble"}
    for body in standin.counts.bodies:
        assert is_strict(speakers(protocol, body)), speakers(protocol, body)
