"""How long the runner waits for the game before it calls something a fault."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeLimits:
    """Limits by the wall clock, seconds.

    Attributes:
        start_s: Until a game that was started has its window, or its menu.
        effect_s: Until a click shows its effect.
        load_s: Until a machine is loaded.
        begin_s: Until the first line of a run, after the start.
        stall_s: Without anything new while a machine runs.
    """

    start_s: float = 240.0
    effect_s: float = 6.0
    load_s: float = 30.0
    begin_s: float = 15.0
    stall_s: float = 15.0

    def scaled(self, factor: float) -> TimeLimits:
        """Limits so many times as long."""
        return TimeLimits(
            **{field.name: factor * getattr(self, field.name) for field in fields(self)}
        )
