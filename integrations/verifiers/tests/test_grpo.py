"""The example that learns by GRPO: its arithmetic, its language, and two updates for real."""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from buildarena_environment import Environment, call

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "examples/learning/grpo"))

jax = pytest.importorskip("jax")

import training  # noqa: E402
from chat_server import answered  # noqa: E402
from languages import ACCEPTED, ENDS, LANGUAGES, REFUSED, SUBMIT, Call, Said  # noqa: E402
from network import Writer, ignorant, log_probabilities, mask, of_conversations  # noqa: E402
from optimisation import (  # noqa: E402
    CLIP,
    RATE,
    Learner,
    advantages,
    batch_of,
    clipped,
    improved,
    log_ratios,
    loss,
    stepped,
)
from rollouts import player  # noqa: E402
from training import Setting  # noqa: E402

BRIDGES, BALANCING = LANGUAGES["support-1"], LANGUAGES["balance-1"]


def conversation(language, seed: int) -> tuple[list[str], list[bool]]:
    """What an ignorant policy writes where everything is accepted."""
    writer, draw = Writer(language, ignorant(language, 0)), np.random.default_rng(seed)
    words, own = [language.task], [False]
    while words[-1] != SUBMIT:
        written = writer.message(words, draw)
        words, own = words + written, own + [True] * len(written)
        if words[-1] != SUBMIT:
            answers = [ACCEPTED] * len(language.calls(written))
            words, own = words + answers, own + [False] * len(answers)
    return words, own


def test_advantages_are_deviations_from_the_groups_own_mean() -> None:
    told = advantages([[1.0, 0.0, 0.0, 1.0], [3.0, 3.0, 3.0, 3.0], [0.0, 0.0, 0.0, 4.0]])
    assert told[0] == pytest.approx([1, -1, -1, 1], rel=1e-3)
    assert told[1] == pytest.approx([0, 0, 0, 0])
    assert told[2] == pytest.approx([-(3**-0.5)] * 3 + [3**0.5], rel=1e-3)


@pytest.mark.parametrize(
    ("ratio", "advantage", "worth"),
    [(1.1, 2.0, 2.2), (1.5, 2.0, 2.4), (0.5, 2.0, 1.0), (1.5, -1.0, -1.5), (0.5, -1.0, -0.8)],
)
def test_a_ratio_beyond_the_clip_gains_nothing_more(ratio, advantage, worth) -> None:
    assert CLIP == 0.2
    assert float(clipped(ratio, advantage)) == pytest.approx(worth)


def test_the_loss_is_the_mean_over_own_words_of_what_was_clipped() -> None:
    told = [conversation(BALANCING, seed) for seed in (1, 2)]
    weights, batch = ignorant(BALANCING, 0), batch_of(BALANCING, told)
    shares = np.asarray(of_conversations(weights, batch.words, batch.allowed))
    now = np.asarray(log_ratios(shares, batch.next_words))
    before = now - np.log(1.5) * batch.own
    expected = []
    for row, worth in ((0, 1.2), (1, -1.5)):
        of_words = []
        for place in np.flatnonzero(batch.own[row]):
            likely = [np.exp(s) for s in shares[row, place][batch.allowed[row, place]]]
            of_words.append(worth - 0.003 * sum(p * np.log(p) for p in likely))
        expected.append(np.mean(of_words))
    found = loss(weights, batch, before, np.array([1.0, -1.0]))
    assert float(found) == pytest.approx(-np.mean(expected), rel=1e-4)


def test_a_step_of_adam_is_as_long_as_its_rate() -> None:
    weights = {"a": np.array([1.0, -2.0], np.float32)}
    learner = Learner.beginning(jax.tree.map(np.asarray, weights))
    moved = stepped(learner, {"a": np.array([0.3, -0.4], np.float32)})
    assert np.asarray(moved.weights["a"]) == pytest.approx([1 - RATE, -2 + RATE], rel=1e-5)
    bounded = stepped(learner, {"a": np.array([30.0, -40.0], np.float32)})
    assert np.asarray(bounded.means["a"]) == pytest.approx([0.06, -0.08], rel=1e-5)


@pytest.mark.parametrize("language", LANGUAGES.values(), ids=LANGUAGES)
def test_probabilities_of_the_words_that_may_come_next_add_up_to_one(language) -> None:
    weights = ignorant(language, 3)
    words, own = conversation(language, 5)
    batch = batch_of(language, [(words, own)])
    shares = np.exp(np.asarray(of_conversations(weights, batch.words, batch.allowed)))
    assert shares.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)
    for place in range(1, len(words)):
        if own[place]:
            choices = language.choices(words[:place])
            assert words[place] in choices
            others = ~mask(language, choices)
            assert not shares[0, place - 1][others].any()
    state = np.zeros(96, np.float32)
    alone = log_probabilities(weights, state, mask(language, language.choices([language.task])))
    assert np.exp(alone).sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("language", LANGUAGES.values(), ids=LANGUAGES)
def test_what_is_written_is_calls_that_the_environment_answers(language) -> None:
    heard = set()
    for seed in range(12):
        environment = Environment(language.task)
        for made in language.opening:
            assert call(environment, made.tool, dict(made.arguments)).accepted
        writer, draw = Writer(language, ignorant(language, seed)), np.random.default_rng(seed)
        said = [Said("user"), Said("assistant", calls=language.opening)]
        while True:
            before, _ = language.read(said)
            written = writer.message(before, draw)
            calls = language.calls(written)
            assert list(language.written(calls)) == written
            assert written[-1] in ENDS
            assert len(before) + len(written) <= language.longest
            said.append(Said("assistant", calls=calls))
            if calls[-1] == Call(SUBMIT, {}):
                break
            for made in calls:
                answer = call(environment, made.tool, dict(made.arguments))
                assert answer.text
                assert (language.heard(answer.text) == ACCEPTED) == answer.accepted
                said.append(Said("tool", text=answer.text))
                heard.add(language.heard(answer.text))
        for made in calls[:-1]:
            answer = call(environment, made.tool, dict(made.arguments))
            assert answer.text
            assert answer.accepted or language is BRIDGES
    if language is BRIDGES:
        assert heard == {ACCEPTED, REFUSED}


def test_a_program_is_what_its_words_say() -> None:
    words = ["+", "5", "up.y", "-", "0.5", 'wheels["4"].speed', SUBMIT]
    program, submission = BALANCING.calls(words)
    assert program.arguments["program"].splitlines()[1] == (
        '  return { spinning_forward = 0 + 5 * sense.up.y - 0.5 * sense.wheels["4"].speed }'
    )
    assert submission.tool == SUBMIT


def test_an_answer_follows_from_weights_conversation_and_seed() -> None:
    writer = Writer(BALANCING, ignorant(BALANCING, 0))
    request = {"model": "m", "seed": 7, "messages": [{"role": "user", "content": "Build."}]}
    first = answered(writer, request)["choices"][0]["message"]
    assert len(first["tool_calls"]) == len(BALANCING.opening)
    request["messages"] += [first]
    second = answered(writer, request)
    assert answered(writer, request) == second
    others = [answered(writer, {**request, "seed": seed}) for seed in range(8, 12)]
    assert any(other["choices"] != second["choices"] for other in others)
    assert json.loads(second["choices"][0]["message"]["tool_calls"][0]["function"]["arguments"])


def test_a_policy_learns_what_a_toy_rewards() -> None:
    """Here a program is worth the share of its terms that read `up.y`."""

    def worth(words: list[str]) -> float:
        return words.count("up.y") / sum(word in BALANCING.SENSES for word in words)

    learner = Learner.beginning(ignorant(BALANCING, 0))
    draw, means = np.random.default_rng(0), []
    for _ in range(15):
        writer = Writer(BALANCING, learner.weights)
        told = []
        for _ in range(16):
            written = writer.message([BALANCING.task], draw)
            told.append(([BALANCING.task, *written], [False, *[True] * len(written)]))
        rewards = [worth(words) for words, _ in told]
        means.append(np.mean(rewards))
        gained = advantages([rewards]).reshape(-1).astype(np.float32)
        learner = improved(learner, batch_of(BALANCING, told), gained)
    assert np.mean(means[:3]) < 0.3
    assert np.mean(means[-3:]) > 0.7


@pytest.mark.parametrize("text", ["1", "-2", "two", "2.5"])
def test_groups_that_teach_nothing_are_refused(text) -> None:
    read = training.at_least(2)
    assert read("2") == 2
    with pytest.raises(argparse.ArgumentTypeError, match=f"'{text}' is no whole number from 2 on"):
        read(text)


@pytest.fixture
def few_tests(monkeypatch):
    monkeypatch.setattr(training, "HELD_OUT", (101,))
    monkeypatch.setattr(training, "TESTS", 1)


def trained(setting: Setting, folder: Path) -> tuple[int, dict]:
    """How many updates there were before, and the run."""
    language = LANGUAGES[setting.task]
    run, learner = training.begun(setting, language, folder)
    before = len(run.updates)
    starts = [*training.TRAINED_ON, *training.HELD_OUT]
    writer = Writer(language, learner.weights)
    with player(writer, start_seeds=starts, simulator="mujoco", processes=1) as players:
        asyncio.run(training.train(players, learner, run, folder))
    return before, asdict(run)


@pytest.mark.usefixtures("few_tests")
@pytest.mark.parametrize("task", LANGUAGES)
def test_two_updates_through_verifiers_repeat_and_go_on_where_they_were(task, tmp_path) -> None:
    setting = Setting(task=task, seed=4, updates=2, groups=1, rollouts=3, simulator="mujoco")
    _, at_once = trained(setting, tmp_path / "at once")
    assert [row["number"] for row in at_once["updates"]] == [1, 2]
    assert set(at_once["tests"]) == {"before", "after"}
    assert at_once["best"]["written"].endswith(SUBMIT)
    assert task == "support-1" or at_once["best"]["reward"] > 0
    part = tmp_path / "in parts"
    trained(replace(setting, updates=1), part)
    # Interrupted between the two files: the second update's row is there, its weights are not.
    stored = json.loads((part / "run.json").read_text())
    stored["updates"].append(at_once["updates"][1])
    (part / "run.json").write_text(json.dumps(stored))
    before, in_parts = trained(setting, part)
    assert before == 1
    for name in ("updates", "tests", "best"):
        assert in_parts[name] == at_once[name]
    with pytest.raises(ValueError, match="another setting"):
        training.begun(replace(setting, seed=5), LANGUAGES[task], part)
