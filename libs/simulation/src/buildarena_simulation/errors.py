"""Errors of buildarena_simulation: a machine's fault, a caller's fault and a crash stay apart."""

from typing import Any, ClassVar


class BuildarenaSimulationError(Exception):
    """Base of every error this package raises."""


class MachineNotSimulable(BuildarenaSimulationError):  # noqa: N818 - it names the machine's state, as a verdict
    """The machine itself cannot be simulated, so its trial fails and is scored so.

    Args:
        reason: What is wrong with the machine, fit to be shown to a person or a model.

    Attributes:
        kind: Which class of reasons it is.
    """

    kind: ClassVar[str] = "not_simulable"

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class ControllerFailed(MachineNotSimulable):
    """A controller's program failed: a fault of the machine, never of the service.

    Its sentence begins with `BEGINNING`.

    Args:
        words: What went wrong.
        line: The line of the program; None if there is none.
        tick: At which tick, from 0; None before the first one.
        time_s: When that was, seconds.

    Attributes:
        line: The line of the program.
        tick: The tick.
    """

    kind: ClassVar[str] = "controller_failed"
    BEGINNING: ClassVar[str] = "the controller failed"

    def __init__(
        self, words: str, *, line: int | None = None, tick: int | None = None, time_s: float = 0.0
    ) -> None:
        at = [] if line is None else [f"line {line}"]
        at += [] if tick is None else [f"tick {tick} ({time_s:.2f} s)"]
        super().__init__(f"{self.BEGINNING}{', ' if at else ''}{', '.join(at)}: {words}")
        self.line, self.tick = line, tick
        self._parts = words, line, tick, time_s

    def __reduce__(self) -> tuple[Any, ...]:
        """Processes hand it to each other."""
        return _failed, self._parts


def _failed(words: str, line: int | None, tick: int | None, time_s: float) -> ControllerFailed:
    return ControllerFailed(words, line=line, tick=tick, time_s=time_s)


class SimulationError(BuildarenaSimulationError):
    """The simulator failed; the trial is never scored and may be tried again."""


class UnknownEngineError(BuildarenaSimulationError, ValueError):
    """No engine has the name asked for; the message lists the valid names."""


class TrajectoryFormatError(BuildarenaSimulationError, ValueError):
    """The bytes are not a trajectory, or one of a schema this version cannot read."""
