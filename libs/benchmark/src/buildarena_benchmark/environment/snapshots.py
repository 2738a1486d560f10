"""Snapshots of episodes: values that can be stored and restored."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Self

from buildarena_benchmark.environment.errors import SnapshotError
from buildarena_benchmark.environment.trials.trials import Trial
from buildarena_geometry import DocumentError, Machine
from buildarena_geometry.documents.log import LoggedState

SNAPSHOT_VERSION: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """State of an episode.

    Attributes:
        changes: Accepted actions that changed a machine.
        trials: The trials so far; without trajectories once the snapshot was written down.
    """

    task: str
    task_version: str
    machines: Mapping[str, LoggedState] = field(default_factory=dict)
    steps: int = 0
    changes: int = 0
    refused: int = 0
    trials: tuple[Trial, ...] = ()
    done: bool = False

    def as_document(self) -> dict[str, Any]:
        """Return JSON values that `from_document` reads: machine documents and a few counts."""
        return {
            "version": SNAPSHOT_VERSION,
            "task": self.task,
            "task_version": self.task_version,
            "machines": {
                name: Machine.restored(value).to_document() for name, value in self.machines.items()
            },
            "steps": self.steps,
            "changes": self.changes,
            "refused": self.refused,
            "trials": [trial.as_document() for trial in self.trials],
            "done": self.done,
        }

    @classmethod
    def from_document(cls, document: object) -> Self:
        """Return a snapshot from `as_document`.

        Raises:
            SnapshotError: It is not a snapshot; the message says what is wrong.
        """
        if not isinstance(document, Mapping):
            raise SnapshotError(f"a state is an object, not {type(document).__name__}")
        if document.get("version") != SNAPSHOT_VERSION:
            raise SnapshotError(
                f"version is {document.get('version')!r}: this release reads {SNAPSHOT_VERSION}"
            )
        try:
            return cls(
                task=str(document["task"]),
                task_version=str(document["task_version"]),
                machines={
                    str(name): Machine.from_document(machine).log
                    for name, machine in document["machines"].items()
                },
                steps=int(document["steps"]),
                changes=int(document["changes"]),
                refused=int(document["refused"]),
                trials=tuple(Trial.from_document(trial) for trial in document["trials"]),
                done=bool(document["done"]),
            )
        except DocumentError as error:
            raise SnapshotError(f"machines: {error}") from error
        except KeyError as error:
            raise SnapshotError(f"{error.args[0]} is missing") from error
        except (AttributeError, TypeError, ValueError) as error:
            raise SnapshotError(f"this is not a state: {error}") from error
