"""Errors of buildarena_simulation: a machine's fault, a caller's fault and a crash."""

from typing import Any, ClassVar


class BuildarenaSimulationError(Exception):
    """Base of every error this package raises."""


class MachineNotSimulable(BuildarenaSimulationError):  # noqa: N818 - it names the machine's state, as a verdict
    """The machine itself cannot be simulated, so its trial fails and is scored so.

    Args:
        reason: Fault of the machine, shown to people and models.

    Attributes:
        kind: Class of the reason.
    """

    kind: ClassVar[str] = "not_simulable"

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class ControllerFailed(MachineNotSimulable):
    """A controller's program failed: a fault of the machine, never of the service.

    Its sentence begins with `BEGINNING`.

    Args:
        words: Description of the failure.
        line: Line of the program; None if unknown.
        tick: Number of the tick, from 0; None before the first one.
        time_s: Time of the tick, seconds.

    Attributes:
        line: The line of the program.
        tick: The tick.
    """

    kind: ClassVar[str] = "controller_failed"
    BEGINNING: ClassVar[str] = "the controller failed"

    def __init__(
        self, text: str, *, line: int | None = None, tick: int | None = None, time_s: float = 0.0
    ) -> None:
        at = [] if line is None else [f"line {line}"]
        at += [] if tick is None else [f"tick {tick} ({time_s:.2f} s)"]
        super().__init__(f"{self.BEGINNING}{', ' if at else ''}{', '.join(at)}: {text}")
        self.line, self.tick = line, tick
        self._parts = text, line, tick, time_s

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, for transfer between processes."""
        return _failed, self._parts


def _failed(text: str, line: int | None, tick: int | None, time_s: float) -> ControllerFailed:
    return ControllerFailed(text, line=line, tick=tick, time_s=time_s)


class SimulationError(BuildarenaSimulationError):
    """The simulator failed; the trial is never scored and may be tried again."""


class UnknownEngineError(BuildarenaSimulationError, ValueError):
    """Unknown engine; the message lists the valid names."""


class TrajectoryFormatError(BuildarenaSimulationError, ValueError):
    """The bytes are not a trajectory, or one of a schema this version cannot read."""
