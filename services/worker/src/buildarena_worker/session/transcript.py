"""Transcripts: what was said and done in a session, turn by turn."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

TRANSCRIPT_VERSION = "1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionRecord:
    """One action of a model.

    Attributes:
        name: The tool it used.
        arguments: What it gave.
        ok: Whether the action was accepted.
        reason: The refusal class, if it was refused.
        feedback: What the model was told.
    """

    name: str
    arguments: Any
    ok: bool
    reason: str | None
    feedback: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """One reply of a model and what came of it."""

    index: int
    stage: str
    sub_structure: str | None
    role: str
    text: str
    actions: tuple[ActionRecord, ...]
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

    def to_json(self) -> bytes:
        """The versioned document that is kept as the job's artifact."""
        document = {"version": TRANSCRIPT_VERSION, "turns": [asdict(turn) for turn in self.turns]}
        return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
