"""Errors of buildarena_simulation: a machine's fault, a caller's fault and a crash stay apart."""


class BuildarenaSimulationError(Exception):
    """Base of every error this package raises."""


class MachineNotSimulable(BuildarenaSimulationError):  # noqa: N818 - it names the machine's state, as a verdict
    """The machine itself cannot be simulated, so its trial fails and is scored so.

    Args:
        reason: What is wrong with the machine, fit to be shown to a person or a model.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class SimulationError(BuildarenaSimulationError):
    """The simulator failed; the trial is never scored and may be tried again."""


class UnknownEngineError(BuildarenaSimulationError, ValueError):
    """No engine has the name asked for; the message lists the valid names."""


class TrajectoryFormatError(BuildarenaSimulationError, ValueError):
    """The bytes are not a trajectory, or one of a schema this version cannot read."""
