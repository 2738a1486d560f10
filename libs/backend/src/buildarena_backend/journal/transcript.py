"""Transcripts: texts and actions of a session, turn by turn, for every kind of player."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

TRANSCRIPT_VERSION = "1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionResult:
    """An action of a model or an agent, and its result.

    Attributes:
        name: The tool that was used.
        ok: Whether the action was accepted.
        reason: The refusal class, if it was refused.
    """

    name: str
    arguments: Any
    ok: bool
    reason: str | None
    feedback: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A reply and its results.

    Attributes:
        index: Place in the transcript, from 0.
        stage: Phase of the workflow; kept transcripts use this key for it.
        sub_structure: The part of the machine that it is about, if it is about one.
    """

    index: int
    stage: str
    sub_structure: str | None
    role: str
    text: str
    actions: tuple[ActionResult, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelTurn(Turn):
    """A turn of a model that the service called, so that its cost is known.

    Attributes:
        input_tokens: Tokens sent.
        output_tokens: Tokens received.
        cost_usd: US dollars with six decimals.
        latency_s: Time until the reply was there, retries included.
        tries: Requests that it took.
    """

    finish: str
    input_tokens: int
    output_tokens: int
    cost_usd: str
    latency_s: float
    tries: int


@dataclass(slots=True)
class Transcript:
    """The turns of a session, in order."""

    turns: list[Turn] = field(default_factory=list)

    @property
    def actions(self) -> int:
        """Actions tried."""
        return sum(len(turn.actions) for turn in self.turns)

    @property
    def refusals(self) -> dict[str, int]:
        """Refused actions by class."""
        return dict(
            Counter(
                action.reason or "refused"
                for turn in self.turns
                for action in turn.actions
                if not action.ok
            )
        )

    def to_json(self, *, spaced: bool = False) -> bytes:
        """Return the versioned document that is kept as the job's artifact.

        Args:
            spaced: Blanks after commas and colons, as in kept transcripts of external agents.
                An artifact's name is the hash of its bytes, so both spellings stay as they are.
        """
        document = {"version": TRANSCRIPT_VERSION, "turns": [asdict(turn) for turn in self.turns]}
        separators = (", ", ": ") if spaced else (",", ":")
        return json.dumps(document, ensure_ascii=False, separators=separators).encode()
