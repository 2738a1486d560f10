"""The policy: a recurrent network that gives each next word a probability."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np
from languages import ENDS, Language
from numpy.typing import NDArray

Weights = dict[str, jax.Array]
"""By name: `embedding` (V, D), `inputs` (D, 3H), `states` (H, 3H), `biases` (3H), `outputs` (H, V),
`output_biases` (V)."""

EMBEDDED: Final = 32
HIDDEN: Final = 96
RARE: Final = 8.0
NEVER: Final = -1e9


def ignorant(language: Language, seed: int) -> Weights:
    """Weights by which all words that may come next are about as likely."""
    draw = np.random.default_rng([seed, 0])
    words = len(language.vocabulary)

    def drawn(rows: int, columns: int, size: float) -> jax.Array:
        return jnp.asarray(size * draw.standard_normal((rows, columns)), dtype=jnp.float32)

    rare = [-np.log(RARE) * (word in language.rare) for word in language.vocabulary]
    return {
        "embedding": drawn(words, EMBEDDED, 1.0),
        "inputs": drawn(EMBEDDED, 3 * HIDDEN, EMBEDDED**-0.5),
        "states": drawn(HIDDEN, 3 * HIDDEN, HIDDEN**-0.5),
        "biases": jnp.zeros(3 * HIDDEN),
        "outputs": drawn(HIDDEN, words, 0.1 * HIDDEN**-0.5),
        "output_biases": jnp.asarray(rare, dtype=jnp.float32),
    }


@jax.jit
def advanced(weights: Weights, state: jax.Array, word: jax.Array) -> jax.Array:
    """The state (…, H) of a gated recurrent unit after one more word (…), given by its number."""
    from_word = weights["embedding"][word] @ weights["inputs"] + weights["biases"]
    from_state = state @ weights["states"]
    update, reset = (
        jax.nn.sigmoid(from_word[..., part] + from_state[..., part])
        for part in (slice(HIDDEN), slice(HIDDEN, 2 * HIDDEN))
    )
    new = jnp.tanh(from_word[..., 2 * HIDDEN :] + reset * from_state[..., 2 * HIDDEN :])
    return update * state + (1 - update) * new


@jax.jit
def log_probabilities(weights: Weights, state: jax.Array, allowed: jax.Array) -> jax.Array:
    """Of each next word (…, V), after a state (…, H), among those that are allowed (…, V)."""
    scores = state @ weights["outputs"] + weights["output_biases"]
    shares: jax.Array = jax.nn.log_softmax(jnp.where(allowed, scores, NEVER))
    return shares


def of_conversations(weights: Weights, words: jax.Array, allowed: jax.Array) -> jax.Array:
    """Log-probabilities of next words (B, T, V), after each of the words of conversations.

    Args:
        weights: The policy.
        words: (B, T) numbers of words.
        allowed: (B, T, V) which may come next.
    """

    def step(state: jax.Array, word: jax.Array) -> tuple[jax.Array, jax.Array]:
        state = advanced(weights, state, word)
        return state, state

    _, states = jax.lax.scan(step, jnp.zeros((len(words), HIDDEN)), words.T)
    shares: jax.Array = log_probabilities(weights, jnp.swapaxes(states, 0, 1), allowed)
    return shares


class Writer:
    """Writes messages, word by word.

    Args:
        language: What may be written.
        weights: The policy.
    """

    def __init__(self, language: Language, weights: Weights) -> None:
        self.language = language
        self.weights = weights
        self._numbers = {word: number for number, word in enumerate(language.vocabulary)}

    def message(self, conversation: Sequence[str], draw: np.random.Generator) -> list[str]:
        """The words of the next message of a conversation, drawn by their probabilities."""
        state, words = jnp.zeros(HIDDEN), list(conversation)
        for word in words:
            state = advanced(self.weights, state, self._numbers[word])
        while choices := self.language.choices(words):
            allowed = mask(self.language, choices)
            shares = np.exp(np.float64(log_probabilities(self.weights, state, allowed)))
            word = self.language.vocabulary[draw.choice(len(shares), p=shares / shares.sum())]
            words.append(word)
            if word in ENDS:
                break
            state = advanced(self.weights, state, self._numbers[word])
        return words[len(conversation) :]


def mask(language: Language, choices: Sequence[str]) -> NDArray[np.bool_]:
    """(V,) which words of a vocabulary are among the choices."""
    return np.array([word in choices for word in language.vocabulary])
