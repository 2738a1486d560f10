"""Group-relative policy optimisation: from groups of rewarded conversations to better weights.

Source: Shao et al., DeepSeekMath (2024), section 4.1, with outcome rewards, a clipped ratio for
each word, and an entropy term in place of the divergence from a reference policy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from languages import Language
from network import Weights, mask, of_conversations
from numpy.typing import ArrayLike, NDArray

CLIP: Final = 0.2
ENTROPY: Final = 0.003
RATE: Final = 3e-3
EPOCHS: Final = 4
LARGEST_GRADIENT: Final = 1.0
SMALLEST_SPREAD: Final = 1e-4
"""Added to a group's standard deviation: a group of equal rewards teaches nothing."""


class Batch(NamedTuple):
    """Conversations, padded.

    Attributes:
        words: (B, T) numbers of the words read.
        next_words: (B, T) numbers of the words that followed.
        allowed: (B, T, V) which might have followed.
        own: (B, T) 1 where the policy wrote what followed, otherwise 0.
    """

    words: NDArray[np.int32]
    next_words: NDArray[np.int32]
    allowed: NDArray[np.bool_]
    own: NDArray[np.float32]


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True, kw_only=True)
class Learner:
    """Weights, and what Adam remembers of their gradients.

    Attributes:
        weights: The policy.
        means: Decaying means of gradients.
        squares: Decaying means of their squares.
        steps: Gradient steps so far.
    """

    weights: Weights
    means: Weights
    squares: Weights
    steps: jax.Array

    @classmethod
    def beginning(cls, weights: Weights) -> Learner:
        """One that has learned nothing yet."""
        nothing = jax.tree.map(jnp.zeros_like, weights)
        return cls(weights=weights, means=nothing, squares=nothing, steps=jnp.zeros((), jnp.int32))


def advantages(rewards: ArrayLike) -> NDArray[np.float64]:
    """How much better each rollout did than its group, in standard deviations.

    Args:
        rewards: (groups, rollouts of a group).
    """
    values = np.asarray(rewards, dtype=np.float64)
    spread = values.std(axis=1, keepdims=True)
    return np.asarray((values - values.mean(axis=1, keepdims=True)) / (spread + SMALLEST_SPREAD))


def batch_of(language: Language, conversations: Sequence[tuple[list[str], list[bool]]]) -> Batch:
    """Conversations as arrays, each as long as any can be.

    Args:
        language: Theirs.
        conversations: The words of each, and which of them the policy wrote.
    """
    numbers = {word: number for number, word in enumerate(language.vocabulary)}
    shape = (len(conversations), language.longest - 1)
    words, next_words = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    allowed = np.ones((*shape, len(numbers)), np.bool_)
    own = np.zeros(shape, np.float32)
    for row, (spoken, written) in enumerate(conversations):
        told = [numbers[word] for word in spoken]
        words[row, : len(told) - 1], next_words[row, : len(told) - 1] = told[:-1], told[1:]
        for place in range(1, len(spoken)):
            if written[place]:
                own[row, place - 1] = 1
                allowed[row, place - 1] = mask(language, language.choices(spoken[:place]))
    return Batch(words, next_words, allowed, own)


def log_ratios(all_shares: jax.Array, next_words: ArrayLike) -> jax.Array:
    """(B, T) log-probabilities of the words that followed, out of those of all words (B, T, V)."""
    chosen = jnp.asarray(next_words)[..., None]
    return jnp.take_along_axis(all_shares, chosen, axis=-1)[..., 0]


def clipped(ratio: jax.Array, advantage: jax.Array) -> jax.Array:
    """What is maximised for a word: nothing is gained by moving its probability beyond the clip."""
    return jnp.minimum(ratio * advantage, jnp.clip(ratio, 1 - CLIP, 1 + CLIP) * advantage)


def loss(weights: Weights, batch: Batch, before: jax.Array, advantage: jax.Array) -> jax.Array:
    """What is minimised: a mean over words within each conversation, and over conversations.

    Args:
        weights: The policy.
        batch: What was written.
        before: (B, T) log-probabilities of its words when they were written.
        advantage: (B,) of each conversation.
    """
    shares = of_conversations(weights, jnp.asarray(batch.words), jnp.asarray(batch.allowed))
    ratio = jnp.exp(log_ratios(shares, batch.next_words) - before)
    entropy = -jnp.sum(jnp.exp(shares) * jnp.where(batch.allowed, shares, 0.0), axis=-1)
    gained = clipped(ratio, advantage[:, None]) + ENTROPY * entropy
    lengths = jnp.maximum(jnp.sum(batch.own, axis=1), 1)
    return -jnp.mean(jnp.sum(batch.own * gained, axis=1) / lengths)


@jax.jit
def improved(learner: Learner, batch: Batch, advantage: jax.Array) -> Learner:
    """The learner after some gradient steps on what its own policy has just written."""
    shares = of_conversations(learner.weights, jnp.asarray(batch.words), jnp.asarray(batch.allowed))
    before = log_ratios(shares, batch.next_words)
    for _ in range(EPOCHS):
        slope = jax.grad(partial(loss, batch=batch, before=before, advantage=advantage))
        learner = stepped(learner, slope(learner.weights))
    return learner


def stepped(learner: Learner, gradient: Weights) -> Learner:
    """The learner after a step of Adam down a gradient, whose length is bounded.

    Source: Kingma and Ba, Adam (2015), algorithm 1, with its constants.
    """
    length = jnp.sqrt(sum(jnp.sum(part**2) for part in jax.tree.leaves(gradient)))
    scale = jnp.minimum(1.0, LARGEST_GRADIENT / (length + 1e-8))
    steps = learner.steps + 1

    def decayed(old: Weights, new: Weights, rate: float, power: int) -> Weights:
        return _mapped(lambda a, b: rate * a + (1 - rate) * (scale * b) ** power, old, new)

    means = decayed(learner.means, gradient, 0.9, 1)
    squares = decayed(learner.squares, gradient, 0.999, 2)

    def moved(weight: jax.Array, mean: jax.Array, square: jax.Array) -> jax.Array:
        size = jnp.sqrt(square / (1 - 0.999**steps)) + 1e-8
        return weight - RATE * mean / (1 - 0.9**steps) / size

    weights = _mapped(moved, learner.weights, means, squares)
    return Learner(weights=weights, means=means, squares=squares, steps=steps)


def _mapped(function: Any, *trees: Weights) -> Weights:
    result: Weights = jax.tree.map(function, *trees)
    return result
